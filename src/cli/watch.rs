//! `sunfleck watch`: the shader loop. The hidden `watch-worker` is the process that renders for it.

use std::ffi::OsString;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::time::Duration;

use clap::Args;
use sunfleck::film::aov::Aov;
use sunfleck::render::{Settings, choose_camera};
use sunfleck::scene::load::Decoded;
use sunfleck::watch::messages::{Estimator, Pose, View};
use sunfleck::watch::session::{self, Options, Serving};
use sunfleck::watch::worker;
use sunfleck::{Error, Result};

use super::estimator_args::EstimatorArgs;
use super::parse;
use super::render::{load_scene, load_scene_again};
use super::tone_args::ToneArgs;

const EXAMPLES: &str = "\
Examples:
  sunfleck shaders export my-shaders
  sunfleck watch --shaders my-shaders                the Cornell box; open the address that is printed
  sunfleck watch scene.gltf --resolution 800x600     reloads the scene when one of its files changes
  sunfleck watch --shaders my-shaders --no-serve     one line for each save, no page
  ssh -L 8417:127.0.0.1:8417 HOST                    to see the page of a machine far away";

/// The port if none is asked for, and it is free.
const PORT: u16 = 8417;

/// Render again whenever a shader or the scene changes, with a live page in the browser.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(super) job: WorkerArgs,
    #[command(flatten)]
    tone: ToneArgs,
    /// Put that camera elsewhere at first: where it is, what it looks at, what is up in the image (else 0,1,0).
    #[arg(long, value_name = "EYE:TARGET[:UP]", allow_hyphen_values = true, value_parser = parse::look_at, help_heading = "Image")]
    look_at: Option<Pose>,
    /// Port of the page [default: 8417, or any that is free].
    #[arg(long, value_name = "N", help_heading = "Page")]
    port: Option<u16>,
    /// Address to listen on. Beyond 127.0.0.1 the page needs the token that is printed.
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), help_heading = "Page")]
    bind: IpAddr,
    /// No page: one line in the terminal for each save.
    #[arg(long, conflicts_with_all = ["port", "bind"], help_heading = "Page")]
    no_serve: bool,
    /// The pixel whose DEBUG_PRINT values are shown, counted from the top left, until another is pinned on the page
    /// [default: the one in the middle].
    #[arg(long, value_name = "X,Y", value_parser = parse::pixel, help_heading = "Image")]
    pixel: Option<[u32; 2]>,
    /// Replace the process that renders if it is silent for so long.
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = parse::duration, help_heading = "Device")]
    hang: Duration,
}

/// What the process that renders must know.
#[derive(Args, Clone, Debug)]
pub(crate) struct WorkerArgs {
    /// A .gltf, .glb or .obj file, or the name of a built-in scene.
    #[arg(default_value = "cornell")]
    scene: String,
    /// Width and height of the image in pixels.
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = parse::resolution, help_heading = "Image")]
    resolution: (u32, u32),
    /// Camera of the scene, by name or index [default: the first].
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Image")]
    camera: Option<String>,
    /// Samples per pixel, after which the picture is finished and nothing runs.
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..), help_heading = "How long")]
    spp: u32,
    /// AOVs to sum besides the image, for tev and for saved EXR files; the page can show every one without.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse::named::<Aov>(Aov::NAMES), help_heading = "Image")]
    aov: Vec<Aov>,
    /// Show the image and the AOVs in the viewer tev whenever it listens there [port: 14158].
    #[arg(long, value_name = "HOST[:PORT]", help_heading = "Image")]
    tev: Option<String>,
    #[command(flatten)]
    pub(super) estimator: EstimatorArgs,
}

impl WorkerArgs {
    fn words(&self) -> Vec<String> {
        let (width, height) = self.resolution;
        let mut words = vec![format!("--resolution={width}x{height}"), format!("--spp={}", self.spp)];
        if self.estimator.seed != 0 {
            words.push(format!("--seed={}", self.estimator.seed));
        }
        if !self.aov.is_empty() {
            let names: Vec<_> = self.aov.iter().map(|aov| aov.name()).collect();
            words.push(format!("--aov={}", names.join(",")));
        }
        words.extend(self.estimator.render_flags());
        words
    }

    fn settings(&self) -> Result<(Settings, super::estimator_args::EnvironmentArgs)> {
        let (width, height) = self.resolution;
        let aovs = Aov::ALL.iter().copied().filter(|aov| self.aov.contains(aov)).collect();
        let mut settings =
            Settings { width, height, spp: self.spp, camera: self.camera.clone(), aovs, ..Settings::default() };
        let environment = self.estimator.clone().apply(&mut settings)?;
        Ok((settings, environment))
    }
}

/// Watches until Ctrl-C.
pub(crate) fn run(args: &WatchArgs) -> anyhow::Result<()> {
    let (settings, environment) = args.job.settings()?;
    // What is wrong with the scene is best said before anything starts; and the camera's index is its.
    let scene = load_scene(&args.job.scene, &environment, true)?;
    let camera = choose_camera(&scene, settings.camera.as_deref())?;
    drop(scene);
    let serving = if args.no_serve { None } else { Some(listen(args)?) };
    if let Some(serving) = &serving {
        let query = serving.token.as_ref().map_or_else(String::new, |token| format!("/?token={token}"));
        eprintln!("page: http://{}{query}", serving.address);
    }
    let words = args.job.words();
    let quoted: Vec<_> = words.iter().map(|word| quote(word)).collect();
    let scene = quote(&args.job.scene);
    // The server compiles: the worker starts with the embedded kernel, which is always good.
    let worker = words.iter().filter(|word| !word.starts_with("--shaders=")).map(OsString::from);
    let mut worker_arguments: Vec<OsString> = vec!["watch-worker".into()];
    worker_arguments.extend(worker);
    worker_arguments.extend(args.job.tev.iter().map(|address| format!("--tev={address}").into()));
    worker_arguments.extend(["--".into(), args.job.scene.clone().into()]);
    let options = Options {
        scene: args.job.scene.clone(),
        environment: environment.file,
        shaders: settings.shaders_dir.clone(),
        worker_arguments,
        view: View {
            camera,
            estimator: Estimator::of(&settings),
            exposure: args.tone.exposure,
            tonemap: args.tone.tonemap.to_string(),
            debug: !args.no_serve,
            pixel: args.pixel,
            pose: args.look_at,
            ..View::default()
        },
        command: format!("sunfleck render {scene} {}", quoted.join(" ")),
        hang: args.hang,
    };
    Ok(session::run(options, serving)?)
}

/// Renders for the server at the other end of standard input and output.
pub(crate) fn run_worker(args: &WorkerArgs) -> anyhow::Result<()> {
    let (settings, environment) = args.settings()?;
    let scene = args.scene.clone();
    let load = move |decoded: &Decoded| {
        load_scene_again(&scene, &environment, true, decoded).map_err(|error| format!("{error:#}"))
    };
    match worker::run(settings, Box::new(load), args.tev.as_deref()) {
        // The server is gone.
        Err(Error::Interrupted) => Ok(()),
        result => Ok(result?),
    }
}

/// A word for a shell; of `--name=value` the value alone is quoted, if it must be.
fn quote(word: &str) -> String {
    let quoted = |text| shlex::try_quote(text).unwrap_or_default().into_owned();
    match word.split_once('=') {
        Some((flag, value)) if flag.starts_with("--") => format!("{flag}={}", quoted(value)),
        _ => quoted(word),
    }
}

fn listen(args: &WatchArgs) -> Result<Serving> {
    let bind = |port| TcpListener::bind(SocketAddr::new(args.bind, port));
    let listener = match args.port {
        Some(port) => bind(port),
        None => bind(PORT).or_else(|_| bind(0)),
    };
    let failed = |e: io::Error| {
        let remedy = match e.kind() {
            io::ErrorKind::AddrInUse => "; give another by --port, or --port 0 for any that is free",
            io::ErrorKind::AddrNotAvailable => "; --bind takes an address of this machine",
            _ => "",
        };
        let port = args.port.unwrap_or(PORT);
        Error::Usage(format!("cannot listen on {} port {port}: {e}{remedy}", args.bind))
    };
    let listener = listener.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let token = if args.bind.is_loopback() { None } else { Some(new_token()?) };
    Ok(Serving { listener, address, token })
}

fn new_token() -> Result<String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|e| Error::Usage(format!("there is no randomness for a token: {e}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
