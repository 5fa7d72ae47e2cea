//! `omnivln barcode FILE.phg`: the barcode of a graph with numbers on its vertices.
//!
//! A .phg file (little endian): the letters `PHG1`, u32 n, u32 m, n times f64 (the values), m times u32 and m times u32 (the ends of the
//! edges). An edge is as high as its lower end.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use arena::mission::stage_clock::CpuScope;
use arena::mission::topo_ph::{Graph, deaths};
use arena::whole_file::write_whole;
use clap::Args;
use serde_json::json;

use crate::memory::peak_extra_bytes;

/// Options of `barcode`.
#[derive(Debug, Args)]
pub struct BarcodeOptions {
    /// Graph file: PHG1, then counts, values and edges (see the front page of apps/omnivln/src/barcode.rs)
    graph: PathBuf,
    /// All bars, one for each vertex in their order: pairs of f64 (little endian), birth and death, NaN if it never dies
    #[arg(long, value_name = "FILE")]
    bars: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Reads, computes, writes, prints. The time and the memory are those from the arrays of the file to the list of bars.
pub fn run(options: &BarcodeOptions) -> Result<ExitCode> {
    let (values, edges) = read_phg(&options.graph).with_context(|| format!("reading {}", options.graph.display()))?;
    let (n, m) = (values.len(), edges.len());
    let ((result, cpu_s), extra_bytes) = peak_extra_bytes(|| {
        let clock = CpuScope::Thread.now();
        let result = Graph::new(values, edges, None).map(|graph| (deaths(&graph), graph));
        (result, clock.elapsed().as_secs_f64())
    });
    let (deaths, graph) = result.with_context(|| options.graph.display().to_string())?;
    let bars = || graph.values().iter().zip(&deaths);
    let essential = deaths.iter().filter(|death| death.is_nan()).count();
    let bars_nonzero = essential + bars().filter(|(birth, death)| birth > death).count();
    if let Some(file) = &options.bars {
        write_whole(file, |out| {
            bars().flat_map(|(birth, death)| [birth, death]).try_for_each(|number| out.write_all(&number.to_le_bytes()))
        })?;
    }
    if options.json {
        let answer = json!({
            "n": n, "m": m, "bars": n, "bars_nonzero": bars_nonzero, "essential": essential, "cpu_s": cpu_s,
            "peak_extra_bytes": extra_bytes,
        });
        arena::say!("{answer}");
    } else {
        arena::say!("{n} vertices, {m} edges: {bars_nonzero} bars of some length, {essential} of them never end");
        arena::say!("{:.1} ms of CPU time from the arrays to the bars", 1e3 * cpu_s);
    }
    Ok(ExitCode::SUCCESS)
}

type Arrays = (Vec<f64>, Vec<(u32, u32)>);

fn read_phg(path: &Path) -> Result<Arrays> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut input = BufReader::new(file);
    let mut head = [0; 12];
    input.read_exact(&mut head).context("it is too short for the head of a .phg file (12 bytes)")?;
    ensure!(
        &head[..4] == b"PHG1",
        "it begins with {:?}, a .phg file begins with \"PHG1\"",
        head[..4].escape_ascii().to_string()
    );
    let count = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let (n, m) = (count(4), count(8));
    // Compared before anything is made room for: a broken count must not take the memory.
    let wanted = 12 + 8 * u64::from(n) + 8 * u64::from(m);
    ensure!(length == wanted, "{n} vertices and {m} edges take {wanted} bytes, it has {length}");
    let mut values = vec![0.0; n as usize];
    for value in &mut values {
        *value = f64::from_le_bytes(next(&mut input)?);
    }
    let mut edges = vec![(0, 0); m as usize];
    for edge in &mut edges {
        edge.0 = u32::from_le_bytes(next(&mut input)?);
    }
    for edge in &mut edges {
        edge.1 = u32::from_le_bytes(next(&mut input)?);
    }
    Ok((values, edges))
}

fn next<const N: usize>(input: &mut impl Read) -> std::io::Result<[u8; N]> {
    let mut bytes = [0; N];
    input.read_exact(&mut bytes)?;
    Ok(bytes)
}
