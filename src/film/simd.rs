//! Loops compiled for the widest SIMD instructions of the machine.

/// [`simd_dispatch`] of an expression.
macro_rules! simd {
    ($work:expr) => {
        $crate::film::simd::simd_dispatch(
            #[inline(always)]
            || $work,
        )
    };
}
pub(crate) use simd;

/// Calls `work` compiled for the widest SIMD instructions of this machine. `work` must be `#[inline(always)]`.
#[inline(always)]
pub fn simd_dispatch<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}
