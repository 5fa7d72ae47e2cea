//! Saving and loading a graph as lines of text, a version first. What follows from the rest (distances, clearance of edges) is not in
//! the file and is measured again, so that a file cannot claim a way that its own cells forbid.
//!
//! ```text
//! far-graph 1
//! config <name> <value>                                            one per setting
//! tile <x> <y> <floor> <exhausted>      row <j> <occupied> <free>  hexadecimal, rows with something in them
//! node <serial> <kind> <x> <y> <floor> <bx> <by> <ax> <ay> <finalized> <covered> <matched> <damper>
//! edge <node> <node> <votes> <count>                               nodes by their place in the file
//! at <node> <x> <y> <floor>                                        the trajectory's last node and place
//! end <next serial>
//! ```

use std::io::{self, BufRead, Read, Write};

use nalgebra::{Point2, Vector2};
use rustc_hash::FxHashSet;

use super::super::vertex::Vertex;
use super::DynamicVisibilityGraph;
use super::config::{FarConfig, FarError};
use super::memory::Spot;
use super::node::{Node, NodeKind};
use super::tile::SIDE;
use super::window::is_sane;

/// Bounds on what a file may hold.
const MAX_TILES: usize = 20_000;
const MAX_STOREYS: usize = 64;
const MAX_NODES: usize = 200_000;
const MAX_EDGES: usize = 2_000_000;
const MAX_LINE: u64 = 400;

/// Why a file is not a graph.
#[derive(Debug, thiserror::Error)]
pub enum FarLoadError {
    /// The reader failed.
    #[error("the graph cannot be read")]
    Io(#[from] io::Error),
    /// The first line is not that of a version this program knows.
    #[error("line 1 is not `far-graph 1`")]
    Version,
    /// A line is not what the format has there.
    #[error("line {line}: {problem}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What would be accepted.
        problem: &'static str,
    },
    /// A setting is outside its range.
    #[error(transparent)]
    Config(#[from] FarError),
}

impl DynamicVisibilityGraph {
    /// Writes everything that a later [`DynamicVisibilityGraph::load`] needs to give the same routes. The matches of nodes that are not yet
    /// frozen are not written: they begin anew.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn save(&self, mut to: impl Write) -> io::Result<()> {
        writeln!(to, "far-graph 1")?;
        for (name, value) in settings(&self.config) {
            writeln!(to, "config {name} {value}")?;
        }
        for tile in &self.memory.tiles {
            writeln!(to, "tile {} {} {} {:x}", tile.key.0, tile.key.1, tile.floor_m, tile.exhausted)?;
            for j in (0..SIDE).filter(|j| tile.occupied[*j] | tile.free[*j] != 0) {
                writeln!(to, "row {j} {:x} {:x}", tile.occupied[j], tile.free[j])?;
            }
        }
        let mut place = vec![0usize; self.nodes.len()];
        for (n, (slot, node)) in self.nodes.iter().enumerate().filter_map(|(s, n)| Some((s, n.as_ref()?))).enumerate() {
            place[slot] = n;
            let Vertex { at, before, after } = node.vertex;
            let kind = match node.kind {
                NodeKind::Convex => "convex",
                NodeKind::Pillar => "pillar",
                NodeKind::Trajectory => "trajectory",
            };
            write!(to, "node {} {kind} {} {} {}", node.serial, at.x, at.y, node.floor_m)?;
            write!(to, " {} {} {} {}", before.x, before.y, after.x, after.y)?;
            let flags = [node.is_finalized, node.is_covered, node.is_matched].map(u8::from);
            writeln!(to, " {} {} {} {}", flags[0], flags[1], flags[2], node.damper)?;
        }
        for (slot, node) in self.nodes.iter().enumerate().filter_map(|(s, n)| Some((s, n.as_ref()?))) {
            let mut links: Vec<_> = node.links.iter().filter(|link| link.to as usize > slot).collect();
            links.sort_unstable_by_key(|link| link.to);
            for link in links {
                let pair = &self.edges.pairs[link.pair as usize];
                writeln!(to, "edge {} {} {} {}", place[slot], place[link.to as usize], pair.votes, pair.count)?;
            }
        }
        let last = self.trajectory.last.filter(|(slot, serial)| self.node(*slot).is_some_and(|n| n.serial == *serial));
        if let (Some((slot, _)), Some(spot)) = (last, self.trajectory.previous) {
            writeln!(to, "at {} {} {} {}", place[slot as usize], spot.at.x, spot.at.y, spot.floor_m)?;
        }
        writeln!(to, "end {}", self.next_serial)
    }

    /// Reads what [`DynamicVisibilityGraph::save`] wrote. Edges are measured against the file's own cells.
    ///
    /// # Errors
    /// The reader's; another version; the first line that is not what the format has there; more than 20,000 tiles, 200,000 nodes or
    /// 2,000,000 edges; settings outside their range.
    pub fn load(from: impl BufRead) -> Result<Self, FarLoadError> {
        let mut lines = Lines { from, line: 0, text: String::new() };
        if lines.next()? != Some("far-graph 1") {
            return Err(FarLoadError::Version);
        }
        let mut config = FarConfig::default();
        while let Some(text) = lines.next()? {
            let mut words = text.split_ascii_whitespace();
            if words.next() != Some("config") {
                break;
            }
            let is_set = words.next().zip(words.next()).is_some_and(|(name, value)| set(&mut config, name, value));
            let holds = is_set && words.next().is_none();
            lines.check(holds, "accepted is `config`, a setting's name and its value")?;
        }
        let mut graph = DynamicVisibilityGraph::new(config)?;
        let mut joined: FxHashSet<(u32, u32)> = FxHashSet::default();
        let mut has_measured = false;
        loop {
            let line = lines.line;
            let fields: Vec<&str> = lines.text.split_ascii_whitespace().collect();
            let wrong = |problem| FarLoadError::Line { line, problem };
            match fields.split_first() {
                Some((&"tile", rest)) if graph.nodes.is_empty() => graph.read_tile(rest).map_err(wrong)?,
                Some((&"row", rest)) if graph.nodes.is_empty() => graph.read_row(rest).map_err(wrong)?,
                Some((&"node", rest)) => graph.read_node(rest).map_err(wrong)?,
                Some((&"edge", rest)) => {
                    if !std::mem::replace(&mut has_measured, true) {
                        graph.memory.remeasure_all();
                    }
                    graph.read_edge(rest, &mut joined).map_err(wrong)?;
                }
                Some((&"at", rest)) => graph.read_at(rest).map_err(wrong)?,
                Some((&"end", rest)) => {
                    let serial: Option<u64> = rest.first().and_then(|word| word.parse().ok());
                    let least = graph.nodes.iter().flatten().map(|node| node.serial + 1).max().unwrap_or(0);
                    let serial = serial.filter(|s| *s >= least && rest.len() == 1);
                    graph.next_serial =
                        serial.ok_or(wrong("accepted is `end` and a serial beyond those of all nodes"))?;
                    break;
                }
                _ => return Err(wrong("accepted are config, tile, row, node, edge, at, end, in this order")),
            }
            if lines.next()?.is_none() {
                return Err(FarLoadError::Line { line, problem: "the file ends before its `end`" });
            }
        }
        if !has_measured {
            graph.memory.remeasure_all();
        }
        graph.pending.clear();
        graph.nodes.iter_mut().flatten().for_each(|node| node.is_pending = false);
        Ok(graph)
    }

    fn read_tile(&mut self, fields: &[&str]) -> Result<(), &'static str> {
        const WANTED: &str = "accepted is `tile`, x, y within 2^24, a floor in m, exhausted blocks in hexadecimal";
        let [x, y, floor, exhausted] = fields else { return Err(WANTED) };
        let key = |word: &str| word.parse().ok().filter(|k: &i32| k.abs() <= 1 << 24);
        let (Some(x), Some(y), Some(floor_m)) = (key(x), key(y), number(floor)) else { return Err(WANTED) };
        let exhausted = u64::from_str_radix(exhausted, 16).map_err(|_| WANTED)?;
        if self.memory.tiles.len() >= MAX_TILES {
            return Err("a graph has at most 20,000 tiles");
        }
        if self.memory.storeys((x, y)) >= MAX_STOREYS {
            return Err("a place has at most 64 storeys");
        }
        let id = self.memory.add_tile((x, y), floor_m);
        self.memory.tiles[id as usize].exhausted = exhausted;
        Ok(())
    }

    fn read_row(&mut self, fields: &[&str]) -> Result<(), &'static str> {
        const WANTED: &str =
            "accepted is `row` after a tile, its number below 64, occupied and free cells in hexadecimal, none both";
        let (Some(tile), [row, occupied, free]) = (self.memory.tiles.last_mut(), fields) else { return Err(WANTED) };
        let row: usize = row.parse().ok().filter(|row| *row < SIDE).ok_or(WANTED)?;
        let bits = |word: &str| u64::from_str_radix(word, 16).map_err(|_| WANTED);
        let (occupied, free) = (bits(occupied)?, bits(free)?);
        if occupied & free != 0 {
            return Err(WANTED);
        }
        (tile.occupied[row], tile.free[row]) = (occupied, free);
        Ok(())
    }

    fn read_node(&mut self, fields: &[&str]) -> Result<(), &'static str> {
        const WANTED: &str = "accepted is `node`, serial, convex, pillar or trajectory, seven finite numbers, three flags 0 or 1, a damper below 256";
        let [serial, kind, x, y, floor, bx, by, ax, ay, finalized, covered, matched, damper] = fields else {
            return Err(WANTED);
        };
        let serial: u64 = serial.parse().ok().filter(|s| *s < u64::MAX).ok_or(WANTED)?;
        let kind = match *kind {
            "convex" => NodeKind::Convex,
            "pillar" => NodeKind::Pillar,
            "trajectory" => NodeKind::Trajectory,
            _ => return Err(WANTED),
        };
        let n = |word: &str| number(word).ok_or(WANTED);
        let flag = |word: &str| match word {
            "0" => Ok(false),
            "1" => Ok(true),
            _ => Err(WANTED),
        };
        if self.nodes.len() >= MAX_NODES {
            return Err("a graph has at most 200,000 nodes");
        }
        let vertex = Vertex {
            at: Point2::new(n(x)?, n(y)?),
            before: Vector2::new(n(bx)?, n(by)?),
            after: Vector2::new(n(ax)?, n(ay)?),
        };
        let mut node = Node::new(serial, vertex, n(floor)?, kind);
        if !is_sane(&self.world(&node.spot())) {
            return Err("a node lies within 1000 km of the origin");
        }
        (node.is_finalized, node.is_covered, node.is_matched) = (flag(finalized)?, flag(covered)?, flag(matched)?);
        node.damper = damper.parse().map_err(|_| WANTED)?;
        self.add_node(node);
        Ok(())
    }

    fn read_edge(&mut self, fields: &[&str], joined: &mut FxHashSet<(u32, u32)>) -> Result<(), &'static str> {
        const WANTED: &str = "accepted is `edge`, two different nodes of the file not yet joined, votes, their count up to connect_votes_size";
        let [a, b, votes, count] = fields else { return Err(WANTED) };
        let slot = |word: &str| word.parse().ok().filter(|n: &u32| (*n as usize) < self.nodes.len());
        let (Some(a), Some(b)) = (slot(a), slot(b)) else { return Err(WANTED) };
        let (Ok(votes), Ok(count)) = (votes.parse::<u16>(), count.parse::<u8>()) else { return Err(WANTED) };
        let is_counted = count >= 1 && count <= self.config.connect_votes_size && u32::from(votes) < 1 << count;
        if a == b || !is_counted || !joined.insert((a.min(b), a.max(b))) {
            return Err(WANTED);
        }
        if joined.len() > MAX_EDGES {
            return Err("a graph has at most 2,000,000 edges");
        }
        let range = self.config.range_m / self.config.voxel_m;
        if !self.edges.restore(&self.memory, &mut self.nodes, (a, b), votes, count, range) {
            return Err("an edge is at most range_m long");
        }
        Ok(())
    }

    fn read_at(&mut self, fields: &[&str]) -> Result<(), &'static str> {
        const WANTED: &str = "accepted is `at`, a node of the file, three finite numbers";
        let [slot, x, y, floor] = fields else { return Err(WANTED) };
        let slot: u32 = slot.parse().map_err(|_| WANTED)?;
        let serial = self.nodes.get(slot as usize).and_then(|n| n.as_ref()).map(|n| n.serial).ok_or(WANTED)?;
        let (Some(x), Some(y), Some(floor_m)) = (number(x), number(y), number(floor)) else { return Err(WANTED) };
        let spot = Spot { at: Point2::new(x, y), floor_m };
        if !is_sane(&self.world(&spot)) {
            return Err(WANTED);
        }
        self.trajectory.last = Some((slot, serial));
        self.trajectory.previous = Some(spot);
        Ok(())
    }
}

/// Lines of bounded length with their number.
struct Lines<R> {
    from: R,
    line: usize,
    text: String,
}

impl<R: BufRead> Lines<R> {
    fn next(&mut self) -> Result<Option<&str>, FarLoadError> {
        self.text.clear();
        self.line += 1;
        let line = self.line;
        let too_long = FarLoadError::Line { line, problem: "a line has at most 400 bytes of text" };
        let read = match self.from.by_ref().take(MAX_LINE).read_line(&mut self.text) {
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::InvalidData => return Err(too_long),
            Err(error) => return Err(error.into()),
        };
        if read as u64 == MAX_LINE {
            return Err(too_long);
        }
        while self.text.ends_with(['\n', '\r']) {
            self.text.pop();
        }
        Ok((read > 0).then_some(self.text.as_str()))
    }

    fn check(&self, holds: bool, problem: &'static str) -> Result<(), FarLoadError> {
        if holds { Ok(()) } else { Err(FarLoadError::Line { line: self.line, problem }) }
    }
}

fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.abs() <= 1e10)
}

fn settings(config: &FarConfig) -> [(&'static str, f64); 16] {
    [
        ("voxel_m", config.voxel_m),
        ("clearance_m", config.clearance_m),
        ("near_m", config.near_m),
        ("match_m", config.match_m),
        ("range_m", config.range_m),
        ("same_layer_m", config.same_layer_m),
        ("connect_votes_size", f64::from(config.connect_votes_size)),
        ("clear_dumper", f64::from(config.clear_dumper)),
        ("node_finalize", f64::from(config.node_finalize)),
        ("filter_pool", f64::from(config.filter_pool)),
        ("angle_noise_rad", config.angle_noise_rad),
        ("accept_align_rad", config.accept_align_rad),
        ("pillar_perimeter_m", config.pillar_perimeter_m),
        ("local_planner_range_m", config.local_planner_range_m),
        ("goal_adjust_radius_m", config.goal_adjust_radius_m),
        ("pairs_per_cycle", f64::from(config.pairs_per_cycle)),
    ]
}

/// Sets one setting; whether there is one of that name and the value is a number of its kind.
fn set(config: &mut FarConfig, name: &str, value: &str) -> bool {
    let place = match name {
        "voxel_m" => &mut config.voxel_m,
        "clearance_m" => &mut config.clearance_m,
        "near_m" => &mut config.near_m,
        "match_m" => &mut config.match_m,
        "range_m" => &mut config.range_m,
        "same_layer_m" => &mut config.same_layer_m,
        "angle_noise_rad" => &mut config.angle_noise_rad,
        "accept_align_rad" => &mut config.accept_align_rad,
        "pillar_perimeter_m" => &mut config.pillar_perimeter_m,
        "local_planner_range_m" => &mut config.local_planner_range_m,
        "goal_adjust_radius_m" => &mut config.goal_adjust_radius_m,
        "pairs_per_cycle" => return value.parse().map(|v| config.pairs_per_cycle = v).is_ok(),
        _ => {
            let place = match name {
                "connect_votes_size" => &mut config.connect_votes_size,
                "clear_dumper" => &mut config.clear_dumper,
                "node_finalize" => &mut config.node_finalize,
                "filter_pool" => &mut config.filter_pool,
                _ => return false,
            };
            return value.parse().map(|v| *place = v).is_ok();
        }
    };
    number(value).map(|v| *place = v).is_some()
}
