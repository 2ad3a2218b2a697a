//! What one edit did, measured: a line in the terminal and an entry on the page.

use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::messages::Frame;

/// Samples per pixel at which edits are compared.
pub(super) const COMPARED_SPP: u32 = 64;

/// An edit and its figures as they come in.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub(super) edit: u32,
    pub(super) what: String,
    #[serde(skip)]
    pub(super) saved: Instant,
    /// GLSL to SPIR-V, in the server.
    pub(super) compile_ms: Option<f64>,
    /// SPIR-V to what the device runs, in the worker.
    pub(super) build_ms: Option<f64>,
    pub(super) first_image_ms: Option<f64>,
    /// Of a scene that was loaded again: what was made anew, and what kept.
    pub(super) reused: Option<String>,
    pub(super) rays_per_second: Option<f64>,
    pub(super) spp: u32,
    pub(super) error: Option<f64>,
    /// Of rays per second, to the edit before.
    pub(super) speed_ratio: Option<f64>,
    /// Of the error at the same number of samples.
    pub(super) error_ratio: Option<f64>,
    pub(super) is_measured: bool,
    /// What the figures were measured on: another view, other figures.
    #[serde(skip)]
    view: String,
    #[serde(skip)]
    start: Option<u32>,
    #[serde(skip)]
    is_said: bool,
    /// A later edit is shown, and this one was not measured to the end.
    is_superseded: bool,
}

impl Report {
    pub(super) fn new(edit: u32, what: String, saved: Instant) -> Self {
        Self {
            edit,
            what,
            saved,
            compile_ms: None,
            build_ms: None,
            first_image_ms: None,
            reused: None,
            rays_per_second: None,
            spp: 0,
            error: None,
            speed_ratio: None,
            error_ratio: None,
            is_measured: false,
            view: String::new(),
            start: None,
            is_said: false,
            is_superseded: false,
        }
    }

    /// Takes in an image of this edit, of what `view` names. `true` once, when it has the samples that are compared. After a
    /// change of the view it is measured again, so that the next edit is held against the same.
    pub(super) fn observe(&mut self, frame: &Frame, view: &str, before: Option<&Self>) -> bool {
        self.first_image_ms.get_or_insert(1e3 * self.saved.elapsed().as_secs_f64());
        if self.start != Some(frame.start) && !frame.moving {
            self.start = Some(frame.start);
            view.clone_into(&mut self.view);
            self.is_measured = false;
            (self.speed_ratio, self.error_ratio) = (None, None);
        }
        if self.is_measured || frame.moving {
            return false;
        }
        self.spp = frame.spp;
        self.error = frame.error;
        self.rays_per_second = Some(frame.rays as f64 / frame.seconds.max(1e-9));
        self.is_measured = frame.spp >= COMPARED_SPP || frame.done;
        if let Some(before) = before.filter(|before| self.is_measured && before.view == self.view) {
            let ratio = |a: Option<f64>, b: Option<f64>| Some(a? / b.filter(|b| *b > 0.0)?);
            self.speed_ratio = ratio(self.rays_per_second, before.rays_per_second);
            // Errors of different numbers of samples are brought to the same by 1/√n.
            let scale = (f64::from(self.spp) / f64::from(before.spp.max(1))).sqrt();
            self.error_ratio = ratio(self.error, before.error).map(|ratio| ratio * scale);
        }
        self.is_measured && !std::mem::replace(&mut self.is_said, self.is_measured)
    }

    /// A later edit is shown: `true` if this one has not had its line.
    pub(super) fn supersede(&mut self) -> bool {
        self.is_superseded |= !self.is_said;
        !std::mem::replace(&mut self.is_said, true)
    }

    /// It cannot be shown, and why has been said.
    pub(super) fn fail(&mut self) {
        self.is_said = true;
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |name: &str, value: Option<f64>| value.map(|value| format!("{name} {value:.0} ms"));
        let ratio = |ratio: Option<f64>| ratio.map_or_else(String::new, |ratio| format!(" (x{ratio:.2})"));
        let superseded = self.is_superseded.then(|| match self.spp {
            0 => "superseded before its first image".to_owned(),
            spp => format!("superseded at {spp} spp"),
        });
        let rate = self.rays_per_second.map(|rate| format!("{:.2} Mrays/s{}", rate / 1e6, ratio(self.speed_ratio)));
        let error = self
            .error
            .map(|error| format!("error {:.2} % at {} spp{}", 100.0 * error, self.spp, ratio(self.error_ratio)));
        let times =
            [ms("compile", self.compile_ms), ms("build", self.build_ms), ms("first image", self.first_image_ms)];
        let parts = self.reused.iter().cloned().chain(times.into_iter().flatten());
        let parts: Vec<_> = parts.chain([superseded, rate, error].into_iter().flatten()).collect();
        write!(f, "{}: {}", self.what, parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(spp: u32, error: f64) -> Frame {
        Frame {
            edit: 1,
            start: 1,
            width: 1,
            height: 1,
            spp,
            seconds: 1.0,
            rays: 2_000_000,
            error: Some(error),
            non_finite: 0,
            done: false,
            moving: false,
            shown: None,
            scale: None,
            statistics: None,
        }
    }

    #[test]
    fn an_edit_is_measured_once_and_held_against_the_one_before() {
        let mut before = Report::new(0, "start".to_owned(), Instant::now());
        assert!(!before.observe(&frame(16, 0.2), "v", None));
        assert!(before.observe(&frame(64, 0.1), "v", None));
        let mut report = Report::new(1, "a.glsl".to_owned(), Instant::now());
        assert!(report.observe(&frame(256, 0.025), "v", Some(&before)));
        assert_eq!((report.speed_ratio, report.error_ratio), (Some(1.0), Some(0.5)));
        assert!(!report.observe(&frame(512, 0.01), "v", Some(&before)));
        let moved = Frame { start: 2, ..frame(64, 0.5) };
        let mut other = report.clone();
        assert!(!other.observe(&moved, "w", Some(&before)), "it was said already");
        assert_eq!((other.speed_ratio, other.error, other.is_measured), (None, Some(0.5), true));
        report.first_image_ms = Some(12.0);
        assert_eq!(
            report.to_string(),
            "a.glsl: first image 12 ms, 2.00 Mrays/s (x1.00), error 2.50 % at 256 spp (x0.50)"
        );
        assert!(!report.supersede(), "it has had its line");
    }

    #[test]
    fn what_is_superseded_says_so_once_with_what_was_measured() {
        let mut report = Report::new(1, "a.png".to_owned(), Instant::now());
        report.reused = Some("1 of 2 images decoded, tree kept".to_owned());
        let mut shown = report.clone();
        assert!(report.supersede() && !report.supersede());
        assert_eq!(report.to_string(), "a.png: 1 of 2 images decoded, tree kept, superseded before its first image");
        assert!(!shown.observe(&frame(16, 0.1), "v", None));
        shown.first_image_ms = Some(12.0);
        assert!(shown.supersede());
        assert_eq!(
            shown.to_string(),
            "a.png: 1 of 2 images decoded, tree kept, first image 12 ms, superseded at 16 spp, 2.00 Mrays/s, \
             error 10.00 % at 16 spp"
        );
    }
}
