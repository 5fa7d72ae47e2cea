//! omni-sim
