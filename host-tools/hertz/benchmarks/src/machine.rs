//! The machine of a measured time: processor, vectors, compiler.

use pulp::{Arch, Simd, WithSimd};
use serde::Serialize;

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Computer {
    /// Name that the system gives it.
    processor: String,
    /// Cores that this process may use.
    cores: usize,
    /// f64 in one of the vectors that this run uses.
    vector_lanes: usize,
    system: String,
    compiler: &'static str,
    /// Compiler flags beyond the workspace's profile.
    flags: &'static str,
}

struct VectorLanes;

impl WithSimd for VectorLanes {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        S::F64_LANES
    }
}

impl Computer {
    pub(crate) fn new() -> Self {
        let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let value = |key: &str| {
            let line = text.lines().find(|line| line.starts_with(key))?;
            line.split_once(':').map(|(_, value)| value.trim().to_owned())
        };
        let named = value("model name").unwrap_or_else(|| "unknown processor".to_owned());
        // A virtual machine may hide the model, but not these.
        let numbers = match (value("cpu family"), value("model\t")) {
            (Some(family), Some(model)) => format!(" (family {family}, model {model})"),
            _ => String::new(),
        };
        Self {
            processor: named + &numbers,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            vector_lanes: Arch::new().dispatch(VectorLanes),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            compiler: env!("COMPILER"),
            flags: env!("FLAGS"),
        }
    }
}

impl std::fmt::Display for Computer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (cores, lanes) = (self.cores, self.vector_lanes);
        let (processor, system, compiler) = (&self.processor, &self.system, self.compiler);
        write!(
            f,
            "{processor}, {cores} cores, vectors of {lanes}, {system}, {compiler}"
        )?;
        if !self.flags.is_empty() {
            write!(f, ", {}", self.flags)?;
        }
        Ok(())
    }
}
