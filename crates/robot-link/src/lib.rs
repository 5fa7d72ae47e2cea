//! robot-link
