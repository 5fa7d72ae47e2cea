//! Scene graphs of spark_dsg (Hydra, Khronos, Clio): their JSON is read (1.0.0 and 1.1.x) and written (1.1.3).
//!
//! Node ids there are 64 bits: a letter in the top 8 and an index in the rest. Here the kind of node is a type, so an object
//! `O(12)` becomes O12. Their layers map one to one; agents become trajectories; an edge between places carries its clearance
//! as the weight; where they have no doorway we take the widest crossing between two rooms; oriented boxes become the
//! axis-aligned boxes around them; functional groups are a layer of their own (2, partition 1, "GROUPS"); relations are edges
//! between objects.
//!
//! Nothing is lost on the way, in either direction. What they say and we have no field for is kept word for word and written back
//! (`spark/kept.rs`); what we say and they have no field for travels in their open `metadata` under `omni_dsg`, which
//! survives their loading and saving, and is only written where their fields alone would not bring the node back. Where
//! the two disagree on the way back (somebody moved a node with their tools), theirs is the newer and holds.

mod attributes;
mod build;
mod kept;
pub(crate) mod mesh;
mod names;
mod ours;
mod plain;
mod read;
mod write;

pub(crate) use kept::{KEPT, is_same};

use std::collections::BTreeMap;
use std::io::{self, Write};

use crate::faults::Faults;
use crate::graph::SceneGraph;
use crate::load::{JsonPath, LoadError};
use crate::mesh::Mesh;
use crate::scan::Document;

/// Letters of node symbols.
pub(crate) const OBJECT: u8 = b'O';
pub(crate) const PLACE: u8 = b'p';
pub(crate) const ROOM: u8 = b'R';
pub(crate) const BUILDING: u8 = b'B';
pub(crate) const GROUP: u8 = b'G';
/// Indices are below this.
pub(crate) const MAX_INDEX: u64 = 1 << 56;

/// Their id of node `index` of a kind.
pub(crate) fn symbol(letter: u8, index: u64) -> u64 {
    (u64::from(letter) << 56) | (index & (MAX_INDEX - 1))
}

/// A scene graph from spark_dsg JSON. Objects are called by `label_names`, else by their name there, else "label 11".
///
/// # Errors
/// Every fault of the text, a node or an edge, with its JSON path. Never a panic, whatever the bytes.
pub fn read_spark_dsg(bytes: &[u8], label_names: Option<&BTreeMap<u32, String>>) -> Result<SceneGraph, LoadError> {
    let (document, fault) = Document::scan(bytes);
    fault.map_or(Ok(()), Err)?;
    read_document(&document, label_names, &mut Faults::fatal())
}

/// Writes a graph, and its mesh if there is one, as spark_dsg JSON.
///
/// The builder's memory of objects and the log stay behind: they are in our own format only.
///
/// # Errors
/// What the writer says.
pub fn write_spark_dsg(graph: &SceneGraph, mesh: Option<&Mesh>, out: &mut impl Write) -> io::Result<()> {
    write::write(graph, mesh, out)
}

/// Whether a document is one of theirs: without a header it is 1.0.0, which has `layer_ids`.
pub(crate) fn is_spark(document: &Document) -> bool {
    document.field("SPARK_DSG_header").is_some() || document.field("layer_ids").is_some()
}

pub(crate) fn read_document(
    document: &Document,
    label_names: Option<&BTreeMap<u32, String>>,
    faults: &mut Faults,
) -> Result<SceneGraph, LoadError> {
    if !is_spark(document) {
        return Err(LoadError::Schema { path: JsonPath("$".into()) });
    }
    read::Import::new(document, label_names, faults).run()
}
