//! `omnivln rooms MAP.png --out labels.png`: a floor plan cut into rooms, or a graph of places.
//!
//! Code and numbers are those of the robots (`mission::rooms`); these also remember the borders of a moment ago.

use std::collections::BTreeSet;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use arena::mission::rooms::{RoomConfig, RoomMap};
use arena::mission::stage_clock::CpuScope;
use arena::mission::topo_ph::{Graph, PinchConfig, pinch};
use arena::mission::volumetric_map::{Cell, OccupancyGrid};
use arena::whole_file::write_whole;
use clap::Args;
use image::{DynamicImage, ImageBuffer, ImageFormat, ImageReader, Luma};
use nalgebra::Point2;
use serde::Deserialize;
use serde_json::json;

use crate::floor_of_places::{Place, rooms_of_places};

/// Options of `rooms`.
#[derive(Debug, Args)]
pub struct RoomsOptions {
    /// Floor plan: a grey picture, white (250 and above) is free, the rest is wall or furniture
    map: Option<PathBuf>,
    /// A graph of places instead: {"nodes": [[x, y, clearance], ...], "edges": [[i, j, clearance], ...]}. Its floor is cut as a plan is;
    /// with [x, y, z, clearance] there may be several floors, and the graph itself is cut
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "resolution"])]
    places: Option<PathBuf>,
    /// Edge of a pixel, metres
    #[arg(long, default_value_t = 0.05, value_name = "M")]
    resolution: f64,
    /// Where the labels go: of a plan a grey PNG of 16 bits (0 none, 1 to N the room), of a graph JSON (a number for each node)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Reads, cuts, writes, prints.
pub fn run(options: &RoomsOptions) -> Result<ExitCode> {
    let answer = match (&options.map, &options.places) {
        (Some(map), _) => of_plan(map, options)?,
        (None, Some(places)) => of_places(places, options)?,
        (None, None) => bail!("name a floor plan, or a graph with --places"),
    };
    if options.json {
        arena::say!("{answer}");
    } else {
        let number = |key: &str| answer[key].as_f64().unwrap_or(0.0);
        arena::say!("{} rooms in {:.0} ms of CPU time", number("rooms"), 1e3 * number("cpu_s"));
    }
    Ok(ExitCode::SUCCESS)
}

fn of_plan(path: &Path, options: &RoomsOptions) -> Result<serde_json::Value> {
    let resolution_m = options.resolution;
    ensure!((0.005..=1.0).contains(&resolution_m), "--resolution {resolution_m}: accepted are 0.005 to 1 metres");
    let place = || format!("reading the floor plan {}", path.display());
    let picture = ImageReader::open(path).with_context(place)?.with_guessed_format().with_context(place)?;
    let picture = picture.decode().with_context(place)?.into_luma8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    // A frame of wall: nobody knows what lies beyond the picture.
    let mut grid = OccupancyGrid::unknown(Point2::origin(), resolution_m, width + 2, height + 2);
    grid.cells.fill(Cell::Occupied);
    for (x, y, pixel) in picture.enumerate_pixels() {
        if pixel.0[0] >= FREE_FROM {
            grid.cells[(y as usize + 1) * (width + 2) + x as usize + 1] = Cell::Free;
        }
    }
    let clock = CpuScope::Thread.now();
    let rooms = RoomMap::new(&grid, None, &RoomConfig::default())?;
    let cpu_s = clock.elapsed().as_secs_f64();
    ensure!(rooms.rooms.len() < usize::from(u16::MAX), "{} rooms are more than 16 bits can number", rooms.rooms.len());
    if let Some(out) = &options.out {
        let label = |x: u32, y: u32| {
            let part = rooms.part_of_cell()[(y as usize + 1) * (width + 2) + x as usize + 1];
            Luma([part.map_or(0, |part| part as u16 + 1)])
        };
        let labels: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_fn(picture.width(), picture.height(), label);
        let mut png = Cursor::new(Vec::new());
        DynamicImage::ImageLuma16(labels).write_to(&mut png, ImageFormat::Png)?;
        write_whole(out, |file| file.write_all(png.get_ref()))?;
    }
    let areas: Vec<f64> = rooms.rooms.iter().map(|room| room.area_m2).collect();
    let doorways: Vec<_> = rooms
        .doorways
        .iter()
        .map(|door| json!({ "between": [door.between.0 + 1, door.between.1 + 1], "width_m": door.width_m }))
        .collect();
    Ok(json!({ "rooms": areas.len(), "cpu_s": cpu_s, "areas_m2": areas, "doorways": doorways }))
}

/// Lighter pixels are free.
const FREE_FROM: u8 = 250;
/// Fewer places are no room.
const SMALLEST_ROOM_PLACES: f64 = 3.0;

#[derive(Deserialize)]
struct PlacesFile {
    nodes: Vec<Vec<f64>>,
    edges: Vec<(u32, u32, f64)>,
}

fn of_places(path: &Path, options: &RoomsOptions) -> Result<serde_json::Value> {
    let text = fs::read_to_string(path).with_context(|| format!("reading the places {}", path.display()))?;
    let file: PlacesFile = serde_json::from_str(&text).with_context(|| {
        format!("{}: wanted are nodes [x, y, clearance] and edges [i, j, clearance]", path.display())
    })?;
    let numbers = file.nodes.first().map_or(3, Vec::len);
    for (number, node) in file.nodes.iter().enumerate() {
        let is_right = matches!(numbers, 3 | 4) && node.len() == numbers;
        ensure!(
            is_right,
            "{}: node {number} has {} numbers; 3 or 4 are wanted, the same for all",
            path.display(),
            node.len()
        );
    }
    let clock = CpuScope::Thread.now();
    let cut = if numbers == 3 { cut_floor } else { cut_graph };
    let labels = cut(&file).with_context(|| path.display().to_string())?;
    let cpu_s = clock.elapsed().as_secs_f64();
    if let Some(out) = &options.out {
        let text = serde_json::to_string(&labels)?;
        write_whole(out, |file| file.write_all(text.as_bytes()))?;
    }
    let rooms: BTreeSet<u32> = labels.iter().copied().filter(|label| *label > 0).collect();
    Ok(json!({ "rooms": rooms.len(), "cpu_s": cpu_s, "labels": labels }))
}

/// Pixel of the floor that is made of places.
const FLOOR_RESOLUTION_M: f64 = 0.05;

fn cut_floor(file: &PlacesFile) -> Result<Vec<u32>> {
    let place = |node: &Vec<f64>| Place { at: Point2::new(node[0], node[1]), clearance_m: node[2] };
    let places: Vec<Place> = file.nodes.iter().map(place).collect();
    rooms_of_places(&places, &file.edges, FLOOR_RESOLUTION_M, &RoomConfig::default())
}

fn cut_graph(file: &PlacesFile) -> Result<Vec<u32>> {
    let values: Vec<f64> = file.nodes.iter().map(|node| node[3]).collect();
    let edges = file.edges.iter().map(|(i, j, _)| (*i, *j)).collect();
    let limits = file.edges.iter().map(|(_, _, clearance)| *clearance).collect();
    let areas = vec![1.0; values.len()];
    let config = PinchConfig { min_area: SMALLEST_ROOM_PLACES, ..PinchConfig::default() };
    let rooms = pinch(&Graph::new(values, edges, Some(limits))?, &areas, &config)?;
    Ok(rooms.part_of.iter().map(|part| part + 1).collect())
}
