//! Which arithmetic a process computes with, and how to make it the same on unlike processors.
//!
//! Loops over elements and sums in them are the same to the bit whatever instructions they are compiled for.
//! Products of matrices are too, but for those that are sums along both operands, of which `gemm` takes as many side by side as
//! the processor has lanes: the same seed then gives other bits where there is AVX-512 and where there is not.
//! Portable arithmetic takes these in eight lanes everywhere.
//!
//! The logarithm, the exponential and the trigonometry of the physics are those of the C library, which is the same to the bit
//! for all processors with AVX2 and fused multiplication (x86-64-v3) if it is of the same version.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

/// An arithmetic that gives the same bits for the same work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Arithmetic {
    /// The same on all x86-64 processors with AVX2 and fused multiplication.
    #[serde(rename = "portable")]
    Portable,
    /// The fastest where there is AVX-512.
    #[serde(rename = "x86-64-v4")]
    X86V4,
    /// The fastest where there is AVX2 with fused multiplication.
    #[serde(rename = "x86-64-v3")]
    X86V3,
    /// That of an older x86-64 processor.
    #[serde(rename = "x86-64")]
    X86,
    /// That of another kind of processor.
    #[serde(rename = "other")]
    Other,
}

static PORTABLE: AtomicBool = AtomicBool::new(false);

/// From now on this process computes portably; to be called before anything is computed.
pub fn make_portable() {
    PORTABLE.store(true, Ordering::Relaxed);
}

impl Arithmetic {
    /// That of this process.
    pub fn of_this_process() -> Self {
        Self::of(Self::of_processor(), is_portable())
    }

    /// That of a processor: the same on unlike ones only where all of them have what it is made of.
    fn of(processor: Self, is_portable: bool) -> Self {
        match processor {
            Self::X86V3 | Self::X86V4 if is_portable => Self::Portable,
            other => other,
        }
    }

    #[cfg(target_arch = "x86_64")]
    fn of_processor() -> Self {
        // What pulp and gemm look for.
        match pulp::Arch::new() {
            pulp::Arch::V4(_) => Self::X86V4,
            pulp::Arch::V3(_) => Self::X86V3,
            _ => Self::X86,
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn of_processor() -> Self {
        Self::Other
    }
}

/// Whether this process computes portably.
pub fn is_portable() -> bool {
    PORTABLE.load(Ordering::Relaxed)
}

impl std::fmt::Display for Arithmetic {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Portable => "portable",
            Self::X86V4 => "x86-64-v4",
            Self::X86V3 => "x86-64-v3",
            Self::X86 => "x86-64",
            Self::Other => "other",
        }
        .fmt(out)
    }
}

#[cfg(test)]
mod tests {
    use super::Arithmetic::{self, Other, Portable, X86, X86V3, X86V4};

    #[test]
    fn only_where_it_is_the_same_bits_it_is_called_portable() {
        let asked = [X86V4, X86V3, X86, Other].map(|processor| Arithmetic::of(processor, true));
        assert_eq!(asked, [Portable, Portable, X86, Other]);
        assert_eq!(Arithmetic::of(X86V4, false), X86V4);
    }
}
