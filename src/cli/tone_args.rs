//! How radiance becomes the numbers of a PNG: the flags that `render` and `merge` share.

use clap::Args;
use sunfleck::film::tonemap::ToneMap;

use super::parse;

/// Exposure and tone curve.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ToneArgs {
    /// Exposure of .png outputs in steps: +1 doubles the brightness.
    #[arg(long, value_name = "EV", default_value = "0", allow_hyphen_values = true, value_parser = parse::exposure_ev, help_heading = "Image")]
    pub(crate) exposure: f32,
    /// Tone curve of .png outputs: clip (min(L, 1)), exponential (1 - exp(-L)), reinhard (L / (1 + L)), aces.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = tone_map_parser(), hide_possible_values = true, help_heading = "Image")]
    pub(crate) tonemap: ToneMap,
}

fn tone_map_parser() -> impl clap::builder::TypedValueParser<Value = ToneMap> {
    const NAMES: [&str; ToneMap::NAMES.len()] = {
        let mut names = [""; ToneMap::NAMES.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = ToneMap::NAMES[i].0;
            i += 1;
        }
        names
    };
    parse::named(&NAMES)
}
