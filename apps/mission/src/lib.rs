//! mission
#![allow(missing_docs)]
pub mod journal;
pub mod openai;
