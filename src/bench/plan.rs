//! What a bench renders, as plain data.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// What a bench renders.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What the images of each row may take, ascending.
    pub rows: Vec<Budget>,
    /// Images of each row, of the seeds `settings.seed ..`; at least two.
    pub seeds: u32,
    /// What they are measured against.
    pub reference: ReferenceChoice,
}

/// Where the reference comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceChoice {
    /// An EXR file.
    File(PathBuf),
    /// A run of another estimator that may take this ([`super::own_reference`]).
    Own(Budget),
}

/// What ends the render of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Samples per pixel.
    Samples(u32),
    /// Seconds of rendering.
    Time(Duration),
}

impl Budget {
    /// One of `parts` equal parts; samples are rounded up.
    #[must_use]
    pub fn part(self, parts: u32) -> Self {
        match self {
            Self::Samples(spp) => Self::Samples(spp.div_ceil(parts)),
            Self::Time(time) => Self::Time(time / parts),
        }
    }

    /// So many times as much; samples at most `u32::MAX`.
    #[must_use]
    pub fn times(self, factor: u32) -> Self {
        match self {
            Self::Samples(spp) => Self::Samples(spp.saturating_mul(factor)),
            Self::Time(time) => Self::Time(time.saturating_mul(factor)),
        }
    }
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(spp) => write!(f, "{spp} spp"),
            Self::Time(time) => write!(f, "{} s", time.as_secs_f64()),
        }
    }
}
