//! omni-perception
