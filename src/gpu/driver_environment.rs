//! The environment that Mesa's lavapipe wants, set before any driver is loaded.
//!
//! lavapipe compiles kernels for vectors of 256 bits at most unless `LP_NATIVE_VECTOR_WIDTH` says otherwise. On processors
//! with AVX-512, 512 bits are faster, and narrow vectors compile in a third of the time: what a run gains by the first it
//! has to win back from the second. So the width follows the number of paths. An image does not depend on it, bit for bit
//! (tests/cli/driver_environment.rs): a lane does the same IEEE operations whatever lies beside it. Mesa's shader cache
//! does not know the width a kernel was compiled for, so each width has a folder of its own (`MESA_SHADER_CACHE_DIR`).
//! What the user has set is left as it is, but that their folder gets one for each width. Measured with Mesa 22.3 and 25.0:
//! docs/benchmarks, "Cold starts".

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::PathBuf;
use std::sync::OnceLock;

use super::cache_folder::cache_folder;
use super::lavapipe::{MesaVersion, lavapipe_versions};

/// Mesa's variable for the width of lavapipe's vectors in bits.
const WIDTH_VARIABLE: &str = "LP_NATIVE_VECTOR_WIDTH";
/// Mesa's variable for the folder of its shader cache.
const CACHE_VARIABLE: &str = "MESA_SHADER_CACHE_DIR";

/// Mesa's variable for how LLVM is used; `nopt` leaves its optimisations out.
const OPTIMISATION_VARIABLE: &str = "GALLIVM_PERF";

/// Up to so many paths, compiling without optimisation for 128 bits takes less time than it costs: a kernel of the
/// Cornell box compiles in 0.41 s and traces 1.1 million paths a second (0.73 s and 2.4 when optimised), a large one in
/// 2.4 s and 0.5 (3.7 s and 1.3).
const MOST_QUICK_PATHS: u64 = 1 << 18;
/// Up to so many paths, 128 bits are better than 512: 2.4 s and 12.7 million paths a second for the Cornell box, 12 s and
/// 1.6 for the large kernel. On a filled shader cache the loss is less than a second.
const MOST_NARROW_PATHS: u64 = 1 << 21;

/// The oldest Mesa whose lavapipe is known to be right and faster with 512 bits.
const FIRST_WIDE_MESA: MesaVersion = MesaVersion { major: 22, minor: 3 };
/// The oldest Mesa whose lavapipe is known to compile narrow vectors in much less time. That of 22.3 does not, and those
/// between were not measured.
const FIRST_SLOW_WIDE_MESA: MesaVersion = MesaVersion { major: 25, minor: 0 };

/// What was done for lavapipe, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriverEnvironment {
    /// Variables that were set.
    pub set: Vec<(&'static str, OsString)>,
    /// Why these, or why none.
    pub reason: String,
}

impl DriverEnvironment {
    fn nothing(reason: impl Into<String>) -> Self {
        Self { set: Vec::new(), reason: reason.into() }
    }
}

impl fmt::Display for DriverEnvironment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in &self.set {
            write!(f, "{name}={} ", value.to_string_lossy())?;
        }
        write!(f, "({})", self.reason)
    }
}

static PREPARED: OnceLock<DriverEnvironment> = OnceLock::new();

/// What [`prepare_driver_environment`] did, if it was called.
pub fn driver_environment() -> Option<&'static DriverEnvironment> {
    PREPARED.get()
}

/// Sets the variables that lavapipe wants for a run of so many paths, or of an unknown number. To be called first of all in
/// `main`: it does nothing once the process has a second thread, or a Vulkan driver may have read its environment.
pub fn prepare_driver_environment(paths: Option<u64>) -> &'static DriverEnvironment {
    PREPARED.get_or_init(|| {
        if !is_single_threaded() {
            return DriverEnvironment::nothing("not the first thing that the process did");
        }
        let chosen = choose(&Circumstances::of_this_process(paths));
        for (name, value) in &chosen.set {
            if *name == CACHE_VARIABLE {
                // Mesa makes a folder, but not those above it. Where this fails it says so, and keeps nothing.
                let _ = std::fs::create_dir_all(value);
            }
            // SAFETY: this is the process's only thread, as was just seen, so nobody reads the environment meanwhile.
            unsafe { std::env::set_var(name, value) };
        }
        chosen
    })
}

/// Whether no other thread exists. Only Linux tells, and lavapipe is at home there.
fn is_single_threaded() -> bool {
    std::fs::read_dir("/proc/self/task").is_ok_and(|tasks| tasks.count() == 1)
}

/// What the choice depends on.
#[derive(Clone, Debug)]
struct Circumstances {
    width: Option<OsString>,
    cache: Option<OsString>,
    optimisation: Option<OsString>,
    has_avx512: bool,
    /// Those whose library the Vulkan loader would load; `None` for one that is not recognised.
    lavapipes: Vec<Option<MesaVersion>>,
    cache_folder: Option<PathBuf>,
    paths: Option<u64>,
}

impl Circumstances {
    fn of_this_process(paths: Option<u64>) -> Self {
        let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        let [width, cache, optimisation] = [WIDTH_VARIABLE, CACHE_VARIABLE, OPTIMISATION_VARIABLE].map(variable);
        // Reading the drivers takes milliseconds, which are spent only where the answer matters.
        let has_avx512 = has_avx512();
        let asks = width.is_none() && (has_avx512 || is_short(paths));
        let lavapipes = if asks { lavapipe_versions() } else { Vec::new() };
        Self { width, cache, optimisation, has_avx512, lavapipes, cache_folder: cache_folder(), paths }
    }
}

/// The extensions that LLVM uses for vectors of 512 bits of 32-bit elements.
fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512cd")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

fn is_short(paths: Option<u64>) -> bool {
    paths.is_some_and(|paths| paths <= MOST_NARROW_PATHS)
}

fn choose(around: &Circumstances) -> DriverEnvironment {
    let folder = match (&around.cache, &around.cache_folder) {
        (Some(_), _) if around.width.is_some() => {
            return DriverEnvironment::nothing(format!("{CACHE_VARIABLE} and {WIDTH_VARIABLE} are set"));
        }
        (Some(folder), _) => PathBuf::from(folder),
        (None, Some(folder)) => folder.join("mesa-shader-cache"),
        (None, None) => return DriverEnvironment::nothing("there is no folder for a shader cache"),
    };
    let cache = |width: &OsStr| (CACHE_VARIABLE, folder.join(width).into_os_string());
    if let Some(width) = &around.width {
        let reason = format!("{WIDTH_VARIABLE} is set, and Mesa's shader cache does not know the width");
        return DriverEnvironment { set: vec![cache(width)], reason };
    }
    if !around.has_avx512 && !is_short(around.paths) {
        return DriverEnvironment::nothing("the processor has no AVX-512");
    }
    let oldest = match around.lavapipes.iter().map(|version| version.filter(|v| *v >= FIRST_WIDE_MESA)).min() {
        None => return DriverEnvironment::nothing("there is no lavapipe"),
        Some(None) => {
            return DriverEnvironment::nothing(format!(
                "a lavapipe that is older than Mesa {FIRST_WIDE_MESA}, or of no known version, keeps its own width"
            ));
        }
        Some(Some(oldest)) => oldest,
    };
    let with = |width: &str, reason: String| DriverEnvironment {
        set: vec![(WIDTH_VARIABLE, width.into()), cache(OsStr::new(width))],
        reason: format!("{reason}, and lavapipe of Mesa {oldest}"),
    };
    match around.paths {
        Some(paths) if paths <= MOST_NARROW_PATHS && oldest >= FIRST_SLOW_WIDE_MESA => {
            let mut chosen = with("128", format!("{paths} paths are soon traced, so compiling must be quick"));
            if paths <= MOST_QUICK_PATHS && around.optimisation.is_none() {
                chosen.set.push((OPTIMISATION_VARIABLE, "nopt".into()));
            }
            chosen
        }
        _ if around.has_avx512 => with("512", "AVX-512".to_owned()),
        _ => DriverEnvironment::nothing("the processor has no AVX-512"),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn around() -> Circumstances {
        Circumstances {
            width: None,
            cache: None,
            optimisation: None,
            has_avx512: true,
            lavapipes: vec![Some(MesaVersion { major: 25, minor: 0 })],
            cache_folder: Some("/cache/sunfleck".into()),
            paths: None,
        }
    }

    #[test]
    fn wide_vectors_where_they_are_faster() {
        let chosen = choose(&around());
        let folder = Path::new("/cache/sunfleck/mesa-shader-cache/512").into();
        assert_eq!(chosen.set, [(WIDTH_VARIABLE, "512".into()), (CACHE_VARIABLE, folder)]);
        let text = chosen.to_string();
        assert!(text.starts_with("LP_NATIVE_VECTOR_WIDTH=512 ") && text.contains("Mesa 25.0"), "{text}");
    }

    #[test]
    fn nothing_where_they_are_not() {
        let old = Some(MesaVersion { major: 22, minor: 2 });
        for lavapipes in [vec![], vec![old], vec![None], vec![Some(FIRST_WIDE_MESA), old]] {
            assert_eq!(choose(&Circumstances { lavapipes: lavapipes.clone(), ..around() }).set, [], "{lavapipes:?}");
        }
        assert_eq!(choose(&Circumstances { has_avx512: false, ..around() }).set, []);
        assert_eq!(choose(&Circumstances { cache_folder: None, ..around() }).set, []);
    }

    #[test]
    fn short_runs_compile_quickly_with_and_without_avx512() {
        let names = |paths, has_avx512| {
            let chosen = choose(&Circumstances { paths: Some(paths), has_avx512, ..around() });
            chosen.set.into_iter().map(|(name, value)| format!("{name}={}", value.display())).collect::<Vec<_>>()
        };
        let narrow = ["LP_NATIVE_VECTOR_WIDTH=128", "MESA_SHADER_CACHE_DIR=/cache/sunfleck/mesa-shader-cache/128"];
        let quick = [&narrow[..], &["GALLIVM_PERF=nopt"]].concat();
        for has_avx512 in [true, false] {
            assert_eq!(names(1, has_avx512), quick);
            assert_eq!(names(MOST_QUICK_PATHS, has_avx512), quick);
            assert_eq!(names(MOST_QUICK_PATHS + 1, has_avx512), narrow);
            assert_eq!(names(MOST_NARROW_PATHS, has_avx512), narrow);
        }
        assert_eq!(names(MOST_NARROW_PATHS + 1, false), [""; 0]);
        assert_eq!(names(MOST_NARROW_PATHS + 1, true)[0], "LP_NATIVE_VECTOR_WIDTH=512");
        let older = Circumstances { paths: Some(1), lavapipes: vec![Some(FIRST_WIDE_MESA)], ..around() };
        assert_eq!(choose(&older).set[0], (WIDTH_VARIABLE, "512".into()), "it compiles wide vectors as quickly");
        let optimised = Circumstances { paths: Some(1), optimisation: Some("no_quad_lod".into()), ..around() };
        assert_eq!(choose(&optimised).set.len(), 2, "what the user has set stays");
    }

    #[test]
    fn what_the_user_has_set_stays() {
        let both = Circumstances { cache: Some("/mine".into()), width: Some("256".into()), ..around() };
        assert_eq!(choose(&both).set, []);
        let chosen = choose(&Circumstances { width: None, ..both });
        let folder = Path::new("/mine/512").into();
        assert_eq!(chosen.set, [(WIDTH_VARIABLE, "512".into()), (CACHE_VARIABLE, folder)], "a folder in theirs");
        let chosen = choose(&Circumstances { width: Some("128".into()), ..around() });
        let folder = Path::new("/cache/sunfleck/mesa-shader-cache/128").into();
        assert_eq!(chosen.set, [(CACHE_VARIABLE, folder)], "a cache for that width");
    }

    #[test]
    fn a_process_with_threads_is_left_alone() {
        // The test harness runs tests in threads of their own.
        assert_eq!(prepare_driver_environment(None).set, []);
        assert!(driver_environment().is_some());
    }
}
