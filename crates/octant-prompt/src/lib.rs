//! octant-prompt
pub mod instruction;
pub mod lexicon;
pub mod octant;
pub mod parser;
pub mod tokens;
pub mod vocabulary;
pub mod grounding {
    /// x
    pub struct GroundingConfig {
        /// x
        pub accept: f64,
    }
}
pub use instruction::*;
pub use octant::*;
pub use parser::*;
pub use tokens::*;
