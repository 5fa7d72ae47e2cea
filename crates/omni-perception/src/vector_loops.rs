//! Loops with the widest vectors that this machine has.
//!
//! The compiler must build for the oldest machine of a kind (four numbers at a time on x86); where eight fit, the same loop is taken in
//! a second build. The numbers are the same to the bit: nothing is reordered, and products and sums are not fused.

/// Runs a loop over plain arrays. What it calls must be `inline(always)`, or it stays as the oldest machine has it.
#[inline]
pub(crate) fn widest<T>(work: impl FnOnce() -> T) -> T {
    pulp::Arch::new().dispatch(work)
}
