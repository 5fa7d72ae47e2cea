//! robot-model
