//! The environment that Mesa's lavapipe wants, set before any driver is loaded.
//!
//! lavapipe compiles kernels for vectors of 256 bits at most unless `LP_NATIVE_VECTOR_WIDTH` says otherwise. On processors
//! with AVX-512, 512 bits are faster from Mesa 25 on and slower before (docs/benchmarks). Mesa's shader cache does not
//! know the width a kernel was compiled for, so each width has a folder of its own (`MESA_SHADER_CACHE_DIR`). What the
//! user has set is left as it is.

use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::lavapipe::{MesaVersion, lavapipe_versions};

/// Mesa's variable for the width of lavapipe's vectors in bits.
const WIDTH_VARIABLE: &str = "LP_NATIVE_VECTOR_WIDTH";
/// Mesa's variable for the folder of its shader cache.
const CACHE_VARIABLE: &str = "MESA_SHADER_CACHE_DIR";

/// The first Mesa whose lavapipe is faster with 512 bits than with 256.
const FIRST_WIDE_MESA: MesaVersion = MesaVersion { major: 25, minor: 0 };

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

/// Sets the variables that lavapipe wants. To be called first of all in `main`: it does nothing once the process has a
/// second thread, or a Vulkan driver may have read its environment.
pub fn prepare_driver_environment() -> &'static DriverEnvironment {
    PREPARED.get_or_init(|| {
        if !is_single_threaded() {
            return DriverEnvironment::nothing("not the first thing that the process did");
        }
        let chosen = choose(&Circumstances::of_this_process());
        for (name, value) in &chosen.set {
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
    has_avx512: bool,
    /// Those whose library the Vulkan loader would load; `None` for one that is not recognised.
    lavapipes: Vec<Option<MesaVersion>>,
    cache_home: Option<PathBuf>,
}

impl Circumstances {
    fn of_this_process() -> Self {
        let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        let home = || variable("HOME").map(|home| Path::new(&home).join(".cache"));
        let (width, cache) = (variable(WIDTH_VARIABLE), variable(CACHE_VARIABLE));
        let has_avx512 = has_avx512();
        // Reading the drivers takes milliseconds, which are spent only where the answer matters.
        let asks = cache.is_none() && width.is_none() && has_avx512;
        let lavapipes = if asks { lavapipe_versions() } else { Vec::new() };
        let cache_home = variable("XDG_CACHE_HOME").map(PathBuf::from).or_else(home);
        Self { width, cache, has_avx512, lavapipes, cache_home }
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

fn choose(around: &Circumstances) -> DriverEnvironment {
    if around.cache.is_some() {
        return DriverEnvironment::nothing(format!("{CACHE_VARIABLE} is set"));
    }
    let Some(home) = &around.cache_home else {
        return DriverEnvironment::nothing("there is no folder for a shader cache");
    };
    let cache = |width: &OsString| {
        let folder = home.join("sunfleck").join("mesa-shader-cache").join(width);
        (CACHE_VARIABLE, folder.into_os_string())
    };
    if let Some(width) = &around.width {
        let reason = format!("{WIDTH_VARIABLE} is set, and Mesa's shader cache does not know the width");
        return DriverEnvironment { set: vec![cache(width)], reason };
    }
    if !around.has_avx512 {
        return DriverEnvironment::nothing("the processor has no AVX-512");
    }
    match around.lavapipes.iter().map(|version| version.filter(|v| *v >= FIRST_WIDE_MESA)).min() {
        None => DriverEnvironment::nothing("there is no lavapipe"),
        Some(None) => DriverEnvironment::nothing(format!(
            "a lavapipe that is older than Mesa {FIRST_WIDE_MESA}, or of no known version, is slower with 512 bits"
        )),
        Some(Some(oldest)) => {
            let width = OsString::from("512");
            let cache = cache(&width);
            let reason = format!("AVX-512, and lavapipe of Mesa {oldest}");
            DriverEnvironment { set: vec![(WIDTH_VARIABLE, width), cache], reason }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around() -> Circumstances {
        Circumstances {
            width: None,
            cache: None,
            has_avx512: true,
            lavapipes: vec![Some(MesaVersion { major: 25, minor: 0 })],
            cache_home: Some("/cache".into()),
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
        let old = Some(MesaVersion { major: 22, minor: 3 });
        for lavapipes in [vec![], vec![old], vec![None], vec![Some(FIRST_WIDE_MESA), old]] {
            assert_eq!(choose(&Circumstances { lavapipes: lavapipes.clone(), ..around() }).set, [], "{lavapipes:?}");
        }
        assert_eq!(choose(&Circumstances { has_avx512: false, ..around() }).set, []);
        assert_eq!(choose(&Circumstances { cache_home: None, ..around() }).set, []);
    }

    #[test]
    fn what_the_user_has_set_stays() {
        assert_eq!(choose(&Circumstances { cache: Some("/mine".into()), ..around() }).set, []);
        let chosen = choose(&Circumstances { width: Some("128".into()), ..around() });
        let folder = Path::new("/cache/sunfleck/mesa-shader-cache/128").into();
        assert_eq!(chosen.set, [(CACHE_VARIABLE, folder)], "a cache for that width");
    }

    #[test]
    fn a_process_with_threads_is_left_alone() {
        // The test harness runs tests in threads of their own.
        assert_eq!(prepare_driver_environment().set, []);
        assert!(driver_environment().is_some());
    }
}
