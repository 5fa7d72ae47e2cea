//! How firm are the rooms? Three rules on ten floor plans, empty and furnished, and on their graphs of places.
//!
//! `cargo test --release -p omnivln --test rooms_study -- --ignored --nocapture --test-threads 1` prints tables, in five minutes of CPU time:
//! 1. every rule with every parameter at half and at one and a half of its default; and with a tenth of noise on the clearance;
//! 2. what is left of the score if the parameters are chosen on nine plans and tried on the tenth;
//! 3. how often rooms change in a row of noisy maps, with and without the partition before;
//! 4. the graphs of places as `omnivln rooms --places` cuts them.

#[path = "../src/floor_of_places.rs"]
mod floor_of_places;
mod scoring;

use std::fs;
use std::path::Path;

use arena::mission::rooms::RoomConfig;
use arena::mission::topo_ph::{
    self, Graph, HydraConfig, HysteresisConfig, IdentityConfig, NO_PART, Origin, PinchConfig, PlateauConfig,
    grid_graph, hydra_partition, match_parts, pinch, pinch_from, plateau_partition,
};
use arena::mission::volumetric_map::{Cell, OccupancyGrid, clearance, fill_islands};
use floor_of_places::{Place, rooms_of_places};
use image::ImageReader;
use nalgebra::Point2;
use scoring::{SPECK_PX, Score, floor_plans, large_only, score, score_of_overlaps, true_rooms};
use serde::Deserialize;

const RESOLUTION_M: f64 = 0.05;
/// Lighter pixels are free.
const FREE_FROM: u8 = 250;

/// What a place stands for: three of them make the smallest room, as in `omnivln rooms --places`.
const PLACE_M2: f64 = 0.5;

/// What stands alone and is no larger is furniture (the defaults of the robots' `RoomConfig`).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Filling {
    area_m2: f64,
    side_m: f64,
}

const FILLING: Filling = Filling { area_m2: 1.0, side_m: 1.2 };

/// A plan or a graph of places, ready to be cut.
struct Subject {
    graph: Graph,
    areas: Vec<f64>,
    /// Where the labels go: the pixel of each vertex (which is itself in a graph of places).
    place_of: Vec<u32>,
    /// Of a plan, the pixels in a row.
    width: Option<usize>,
    truth: Vec<u32>,
    /// Labels with at most so many members are none.
    speck: usize,
    /// Regions below this area are none, as in `RoomMap`.
    least_room: f64,
}

/// The ten plans in one state, or their graphs.
struct Set {
    names: Vec<String>,
    grids: Vec<OccupancyGrid>,
    truths: Vec<Vec<u32>>,
}

impl Set {
    fn load(folder: &Path, suffix: &str) -> Set {
        let mut set = Set { names: names(folder), grids: Vec::new(), truths: Vec::new() };
        for name in &set.names {
            let grey = |file: String| ImageReader::open(folder.join(file)).unwrap().decode().unwrap().into_luma8();
            let plan = grey(format!("{name}{suffix}.png"));
            let (width, height) = (plan.width() as usize, plan.height() as usize);
            // A frame of wall, as in `omnivln rooms`.
            let mut grid = OccupancyGrid::unknown(Point2::origin(), RESOLUTION_M, width + 2, height + 2);
            grid.cells.fill(Cell::Occupied);
            let mut truth = vec![0; grid.cells.len()];
            let rooms = true_rooms(&grey(format!("{name}_gt_segmentation.png")));
            for (x, y, pixel) in plan.enumerate_pixels() {
                let (x, y) = (x as usize, y as usize);
                let cell = (y + 1) * (width + 2) + x + 1;
                truth[cell] = rooms[y * width + x];
                if pixel.0[0] >= FREE_FROM {
                    grid.cells[cell] = Cell::Free;
                }
            }
            set.grids.push(grid);
            set.truths.push(truth);
        }
        set
    }

    fn subjects(&self, filling: Filling) -> Vec<Subject> {
        let plans = self.grids.iter().zip(&self.truths);
        let subject = |(grid, truth): (&OccupancyGrid, &Vec<u32>)| {
            let filled = fill_islands(grid, filling.area_m2, filling.side_m);
            let (graph, place_of) = grid_graph(&clearance(&filled, true), grid.width);
            let areas = vec![RESOLUTION_M * RESOLUTION_M; graph.len()];
            Subject {
                graph,
                areas,
                place_of,
                width: Some(grid.width),
                truth: truth.clone(),
                speck: SPECK_PX,
                least_room: 1.5,
            }
        };
        plans.map(subject).collect()
    }
}

/// The plans of the folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> =
        files.filter_map(|name| Some(name.strip_suffix("_gt_segmentation.png")?.to_owned())).collect();
    names.sort_unstable();
    names
}

#[derive(Deserialize)]
struct PlacesFile {
    nodes: Vec<Vec<f64>>,
    edges: Vec<(u32, u32, f64)>,
    gt_room: Vec<u32>,
}

fn places_file(folder: &Path, name: &str, suffix: &str) -> PlacesFile {
    let file = fs::read(folder.join(format!("places/{name}{suffix}.json"))).unwrap();
    serde_json::from_slice(&file).unwrap()
}

fn places(folder: &Path, suffix: &str) -> Vec<Subject> {
    let subject = |name: &String| {
        let file = places_file(folder, name, suffix);
        let values: Vec<f64> = file.nodes.iter().map(|node| node[2]).collect();
        let limits = file.edges.iter().map(|edge| edge.2).collect();
        let n = values.len();
        let graph = Graph::new(values, file.edges.iter().map(|edge| (edge.0, edge.1)).collect(), Some(limits));
        Subject {
            graph: graph.unwrap(),
            areas: vec![PLACE_M2; n],
            place_of: (0..n as u32).collect(),
            width: None,
            truth: file.gt_room,
            speck: 0,
            least_room: 0.0,
        }
    };
    names(folder).iter().map(subject).collect()
}

/// A rule with its parameters.
#[derive(Debug, Clone, Copy)]
enum Rule {
    Plateau(PlateauConfig),
    Hydra(HydraConfig),
    Pinch(PinchConfig),
}

impl Rule {
    fn labels(&self, subject: &Subject, graph: &Graph) -> Vec<u32> {
        let partition = match self {
            Rule::Plateau(config) => plateau_partition(graph, config).unwrap(),
            Rule::Hydra(config) => hydra_partition(graph, &subject.areas, config).unwrap(),
            Rule::Pinch(config) => pinch(graph, &subject.areas, config).unwrap(),
        };
        let mut labels = vec![0; subject.truth.len()];
        let mut area = vec![0.0; partition.parts.len()];
        for (part, vertex_area) in partition.part_of.iter().zip(&subject.areas) {
            area[*part as usize] += vertex_area;
        }
        for (part, place) in partition.part_of.iter().zip(&subject.place_of) {
            if area[*part as usize] >= subject.least_room {
                labels[*place as usize] = part + 1;
            }
        }
        labels
    }

    fn score(&self, subject: &Subject) -> Score {
        score(&subject.truth, &self.labels(subject, &subject.graph), subject.speck)
    }

    fn mean(&self, subjects: &[Subject]) -> Score {
        Score::mean(&subjects.iter().map(|subject| self.score(subject)).collect::<Vec<_>>())
    }
}

/// A rule and what can be turned at it.
struct Family {
    title: &'static str,
    /// Name, default, largest value that makes sense.
    parameters: &'static [(&'static str, f64, f64)],
    rule: fn(&[f64]) -> Rule,
}

const FAMILIES: [Family; 3] = [
    Family {
        title: "Eq. 5",
        parameters: &[("t_min", 0.3, 9.0), ("t_max", 1.2, 9.0), ("min_persistence", 0.1, 9.0)],
        rule: |p| {
            let config = PlateauConfig { t_min: p[0], t_max: p[1], min_persistence: p[2], ..PlateauConfig::default() };
            Rule::Plateau(config)
        },
    },
    Family {
        title: "Hydra-like",
        parameters: &[("t_min", 0.5, 9.0), ("t_max", 1.2, 9.0), ("min_ratio", 0.25, 1.0), ("min_area", 1.0, 9.0)],
        rule: |p| Rule::Hydra(HydraConfig { t_min: p[0], t_max: p[1], min_ratio: p[2], min_area: p[3] }),
    },
    Family {
        title: "Pinch",
        parameters: &[("rho", 0.88, 1.0), ("sigma", 0.75, 1.0), ("tau", 0.07, 9.0), ("min_area", 1.5, 9.0)],
        rule: |p| Rule::Pinch(PinchConfig { rho: p[0], sigma: p[1], tau: p[2], min_area: p[3] }),
    },
];

impl Family {
    fn defaults(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.1).collect()
    }

    /// The defaults, and each parameter at half and at one and a half.
    fn variations(&self) -> Vec<(String, Rule)> {
        let mut rows = vec![(format!("**{}**", self.title), (self.rule)(&self.defaults()))];
        for (index, &(name, default, most)) in self.parameters.iter().enumerate() {
            for share in [0.5, 1.5] {
                let mut values = self.defaults();
                values[index] = (share * default).min(most);
                rows.push((format!("{} {name} {:.3}", self.title, values[index]), (self.rule)(&values)));
            }
        }
        rows
    }
}

#[test]
fn the_study_uses_the_defaults() {
    let [eq_5, hydra, own] = FAMILIES.map(|family| (family.rule)(&family.defaults()));
    assert!(matches!(eq_5, Rule::Plateau(config) if config == PlateauConfig::default()));
    assert!(matches!(hydra, Rule::Hydra(config) if config == HydraConfig::default()));
    assert!(matches!(own, Rule::Pinch(config) if config == PinchConfig::default()));
}

/// A row of normal numbers, the same for the same seed (splitmix64, Box and Muller).
fn normal_numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0xD1B5_4A32_D192_ED03);
    let mut uniform = move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = state;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

/// How the noise of neighbouring pixels hangs together.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Noise {
    /// Each pixel by itself, as no distance to walls can be.
    White,
    /// Drawn every half metre, between them a mixture: walls that are seen a little wrong.
    Smooth,
}

/// Clearances multiplied by 1 + `share` times a normal number. In a graph of places each place and each way has its own.
fn noisy(subject: &Subject, noise: Noise, share: f64, seed: u64) -> Graph {
    let graph = &subject.graph;
    let mut normal = normal_numbers(seed);
    let moved = |value: f64, normal: f64| (value * (1.0 + share * normal)).max(0.0);
    let Some(width) = subject.width else {
        let values = graph.values().iter().map(|value| moved(*value, normal())).collect();
        let limits = graph.edge_weights().map(|weight| moved(weight, normal())).collect();
        return Graph::new(values, graph.edges().to_vec(), Some(limits)).unwrap();
    };
    const KNOT_PX: usize = 10;
    let columns = width / KNOT_PX + 2;
    let knots: Vec<f64> = (0..columns * (subject.truth.len() / width / KNOT_PX + 2)).map(|_| normal()).collect();
    let smooth = |cell: usize| {
        let (x, y) = (cell % width, cell / width);
        let weight = |pixel: usize, side: usize| {
            let share = (pixel % KNOT_PX) as f64 / KNOT_PX as f64;
            if side == 0 { 1.0 - share } else { share }
        };
        let (mut sum, mut squares) = (0.0, 0.0_f64);
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight = weight(x, right) * weight(y, down);
            sum += weight * knots[(y / KNOT_PX + down) * columns + x / KNOT_PX + right];
            squares += weight * weight;
        }
        // As strong between the knots as on them.
        sum / squares.sqrt()
    };
    let values = graph.values().iter().zip(&subject.place_of).map(|(value, place)| match noise {
        Noise::White => moved(*value, normal()),
        Noise::Smooth => moved(*value, smooth(*place as usize)),
    });
    Graph::new(values.collect(), graph.edges().to_vec(), None).unwrap()
}

/// The four columns: plans empty and furnished, graphs of places empty and furnished.
fn columns(folder: &Path, filling: Filling) -> [Vec<Subject>; 4] {
    [
        Set::load(folder, "").subjects(filling),
        Set::load(folder, "_furnitures").subjects(filling),
        places(folder, ""),
        places(folder, "_furnitures"),
    ]
}

fn print_row(title: &str, scores: &[Score]) {
    print!("| {title} |");
    for score in scores {
        print!(" {:.3} / {:.3} |", score.overlap, score.f1);
    }
    println!();
}

fn mean_of_noise(rule: &Rule, subjects: &[Subject], noise: Noise, share: f64) -> Score {
    let score_of = |(seed, subject): (usize, &Subject)| {
        let labels = rule.labels(subject, &noisy(subject, noise, share, seed as u64));
        score(&subject.truth, &labels, subject.speck)
    };
    Score::mean(&subjects.iter().enumerate().map(score_of).collect::<Vec<_>>())
}

#[test]
#[ignore = "minutes, and wants --release"]
fn every_parameter_at_half_and_at_one_and_a_half_and_noise() {
    let Some(folder) = floor_plans() else { return };
    let columns = columns(&folder, FILLING);
    println!("| mIoU / F1 at 0.5 | plans, empty | plans, furnished | places, empty | places, furnished |");
    println!("|---|---|---|---|---|");
    let mut best_of_rivals = [0.0_f64; 2];
    for family in &FAMILIES {
        for (title, rule) in family.variations() {
            let scores = columns.each_ref().map(|subjects| rule.mean(subjects));
            print_row(&title, &scores);
            if family.title != "Pinch" {
                best_of_rivals = [0, 1].map(|column| best_of_rivals[column].max(scores[column].overlap));
            }
        }
    }
    let default = Rule::Pinch(PinchConfig::default());
    drop(columns);
    for (title, filling) in [
        ("nothing filled", Filling { area_m2: 0.0, side_m: 0.0 }),
        ("filled up to 0.5 m²", Filling { area_m2: 0.5, ..FILLING }),
        ("filled up to 1.5 m²", Filling { area_m2: 1.5, ..FILLING }),
        ("filled up to 0.6 m", Filling { side_m: 0.6, ..FILLING }),
        ("filled up to 1.8 m", Filling { side_m: 1.8, ..FILLING }),
    ] {
        let scores = ["", "_furnitures"].map(|suffix| default.mean(&Set::load(&folder, suffix).subjects(filling)));
        print_row(&format!("Pinch, {title}"), &scores);
    }
    let literal = PlateauConfig { t_min: 0.0, t_max: 1e3, min_persistence: 0.0, ..PlateauConfig::default() };
    let unfilled = ["", "_furnitures"].map(|suffix| {
        let subjects = Set::load(&folder, suffix).subjects(Filling { area_m2: 0.0, side_m: 0.0 });
        Rule::Plateau(literal).mean(&subjects)
    });
    print_row("Eq. 5 to the letter, nothing filled", &unfilled);
    let own = ["", "_furnitures"].map(|suffix| default.mean(&Set::load(&folder, suffix).subjects(FILLING)).overlap);
    assert!(own[0] > best_of_rivals[0] && own[1] > best_of_rivals[1], "{own:?} {best_of_rivals:?}");
}

#[test]
#[ignore = "minutes, and wants --release"]
fn a_tenth_of_noise_on_the_clearance() {
    let Some(folder) = floor_plans() else { return };
    let columns = columns(&folder, FILLING);
    println!("| mIoU / F1 at 0.5 | plans, empty | plans, furnished | places, empty | places, furnished |");
    println!("|---|---|---|---|---|");
    for family in &FAMILIES {
        let default = (family.rule)(&family.defaults());
        let scores = columns.each_ref().map(|subjects| mean_of_noise(&default, subjects, Noise::Smooth, 0.1));
        print_row(&format!("{}, noise of 10 %", family.title), &scores);
        let scores = [0, 1].map(|column| mean_of_noise(&default, &columns[column], Noise::White, 0.1));
        print_row(&format!("{}, noise of 10 % on each pixel by itself", family.title), &scores);
    }
}

/// The same subject with each basin (a peak and what drains to it) as one vertex: a hundredth of the work, and the same regions but for ties.
struct Basins {
    graph: Graph,
    areas: Vec<f64>,
    /// Pixels of each basin in each true room (0 none).
    in_rooms: Vec<Vec<f64>>,
    least_room: f64,
}

impl Basins {
    fn new(subject: &Subject) -> Basins {
        let all = PinchConfig { rho: 1.0, sigma: 1.0, tau: 0.0, min_area: 0.0 };
        let basins = pinch(&subject.graph, &subject.areas, &all).unwrap();
        let values = basins.parts.iter().map(|part| part.peak_value).collect();
        let edges = basins.borders.iter().map(|border| (border.a, border.b)).collect();
        let limits = basins.borders.iter().map(|border| border.saddle).collect();
        let (truth, rooms) = large_only(&subject.truth, subject.speck);
        let mut in_rooms = vec![vec![0.0; rooms + 1]; basins.parts.len()];
        for (basin, place) in basins.part_of.iter().zip(&subject.place_of) {
            in_rooms[*basin as usize][truth[*place as usize]] += 1.0;
        }
        // True floor that is no floor of the map must count as well: a basin of its own that is in no part.
        let mut outside = vec![0.0; rooms + 1];
        truth.iter().for_each(|room| outside[*room] += 1.0);
        in_rooms.iter().flat_map(|row| row.iter().enumerate()).for_each(|(room, pixels)| outside[room] -= pixels);
        in_rooms.push(outside);
        Basins {
            graph: Graph::new(values, edges, Some(limits)).unwrap(),
            areas: basins.parts.iter().map(|part| part.area).collect(),
            in_rooms,
            least_room: subject.least_room,
        }
    }

    fn score(&self, config: &PinchConfig) -> Score {
        let found = pinch(&self.graph, &self.areas, config).unwrap();
        let mut next = 0;
        let number = |part: &topo_ph::Part| {
            let is_room = part.area >= self.least_room;
            next += usize::from(is_room);
            if is_room { next } else { 0 }
        };
        let numbers: Vec<usize> = found.parts.iter().map(number).collect();
        let (rooms, parts) = (self.in_rooms[0].len() - 1, next);
        let mut shared = vec![0.0; (rooms + 1) * (parts + 1)];
        for (basin, in_rooms) in self.in_rooms.iter().enumerate() {
            let part = found.part_of.get(basin).map_or(0, |part| numbers[*part as usize]);
            for (room, pixels) in in_rooms.iter().enumerate() {
                shared[room * (parts + 1) + part] += pixels;
            }
        }
        score_of_overlaps(&shared, rooms, parts)
    }
}

/// What is tried when the parameters are chosen.
fn grid_of_parameters() -> Vec<PinchConfig> {
    let mut grid = Vec::new();
    for rho in [0.82, 0.85, 0.88, 0.91] {
        for sigma in [0.65, 0.7, 0.75, 0.8] {
            for tau in [0.04, 0.07, 0.1] {
                for min_area in [1.0, 1.5, 2.0] {
                    grid.push(PinchConfig { rho, sigma, tau, min_area });
                }
            }
        }
    }
    grid
}

#[test]
#[ignore = "minutes, and wants --release"]
fn chosen_on_nine_plans_and_tried_on_the_tenth() {
    let Some(folder) = floor_plans() else { return };
    let names = names(&folder);
    let mut choices: Vec<(Filling, PinchConfig)> = Vec::new();
    // By choice, plan and state (empty, furnished).
    let mut scores: Vec<Vec<[Score; 2]>> = Vec::new();
    let fillings = [(1.0, 1.2), (0.5, 1.2), (1.5, 1.2), (1.0, 0.9), (1.0, 1.5)];
    for (area_m2, side_m) in fillings {
        let filling = Filling { area_m2, side_m };
        let grid = grid_of_parameters();
        let mut of_grid = vec![vec![[Score::default(); 2]; names.len()]; grid.len()];
        for (state, suffix) in ["", "_furnitures"].into_iter().enumerate() {
            let subjects = Set::load(&folder, suffix).subjects(filling);
            let basins: Vec<Basins> = subjects.iter().map(Basins::new).collect();
            for (config, of_config) in grid.iter().zip(&mut of_grid) {
                for (plan, basins) in basins.iter().enumerate() {
                    of_config[plan][state] = basins.score(config);
                }
            }
            if filling == FILLING {
                let config = PinchConfig::default();
                let fast = Score::mean(&basins.iter().map(|basins| basins.score(&config)).collect::<Vec<_>>());
                let plain = Rule::Pinch(config).mean(&subjects);
                println!("defaults{suffix}: pixels {plain:.3?}, basins {fast:.3?}");
                assert!((fast.overlap - plain.overlap).abs() < 0.01);
            }
        }
        choices.extend(grid.into_iter().map(|config| (filling, config)));
        scores.extend(of_grid);
    }
    let total = |of_choice: &[[Score; 2]], left_out: usize| -> f64 {
        let rest = of_choice.iter().enumerate().filter(|(plan, _)| *plan != left_out);
        rest.map(|(_, both)| both.iter().map(|score| score.overlap + score.f1).sum::<f64>()).sum()
    };
    println!("| left out | chosen: island m², m; rho, sigma, tau, min_area | empty | furnished |");
    println!("|---|---|---|---|");
    let mut tried = [Vec::new(), Vec::new()];
    for (plan, name) in names.iter().enumerate() {
        // The first of equals.
        let best = (0..choices.len())
            .rev()
            .max_by(|&a, &b| total(&scores[a], plan).total_cmp(&total(&scores[b], plan)))
            .unwrap();
        let (filling, config) = choices[best];
        let title = format!(
            "{name} | {} {}; {} {} {} {}",
            filling.area_m2, filling.side_m, config.rho, config.sigma, config.tau, config.min_area
        );
        print_row(&title, &scores[best][plan]);
        tried[0].push(scores[best][plan][0]);
        tried[1].push(scores[best][plan][1]);
    }
    let means = tried.map(|scores| Score::mean(&scores));
    print_row(&format!("**mean** | of {} choices", choices.len()), &means);
    assert!(means[0].overlap >= 0.90 && means[1].overlap >= 0.84, "{means:?}");
}

/// Maps in the row.
const FRAMES: u64 = 8;

#[test]
#[ignore = "minutes, and wants --release"]
fn a_row_of_noisy_maps() {
    let Some(folder) = floor_plans() else { return };
    let subjects = Set::load(&folder, "").subjects(FILLING);
    println!(
        "| noise, smooth | rooms that came or went in {} steps, plain | with the partition before | floor that changed its room, plain | ... |",
        FRAMES - 1
    );
    println!("|---|---|---|---|---|");
    for share in [0.005, 0.01, 0.02, 0.05] {
        let (mut changes, mut moved, mut floor) = ([0, 0], [0.0, 0.0], 0.0);
        for subject in &subjects {
            let mut before = [vec![NO_PART; subject.graph.len()], vec![NO_PART; subject.graph.len()]];
            for frame in 0..FRAMES {
                let graph = noisy(subject, Noise::Smooth, share, frame);
                let plain = pinch(&graph, &subject.areas, &PinchConfig::default()).unwrap();
                let hysteresis = HysteresisConfig::default();
                let kept =
                    pinch_from(&graph, &subject.areas, &PinchConfig::default(), &before[1], &hysteresis).unwrap();
                for (rule, now) in [plain, kept].into_iter().enumerate() {
                    if frame > 0 {
                        let matching =
                            match_parts(&before[rule], &now.part_of, &subject.areas, &IdentityConfig::default())
                                .unwrap();
                        let is_old = |origin: &&Origin| matches!(origin, Origin::Survived { .. });
                        let kept_names = matching.origins.iter().filter(is_old).count();
                        changes[rule] += matching.origins.len() - kept_names + matching.lost.len();
                        let pairs = before[rule].iter().zip(&now.part_of).zip(&subject.areas);
                        let elsewhere = pairs.filter(|((old, new), _)| matching.heir_of(**new) != Some(**old));
                        moved[rule] += elsewhere.map(|(_, area)| area).sum::<f64>();
                    }
                    before[rule] = now.part_of;
                }
            }
            floor += (FRAMES - 1) as f64 * subject.areas.iter().sum::<f64>();
        }
        let percent = moved.map(|area| 100.0 * area / floor);
        println!(
            "| {:.1} % | {} | {} | {:.2} % | {:.2} % |",
            100.0 * share,
            changes[0],
            changes[1],
            percent[0],
            percent[1]
        );
        assert!(changes[1] <= changes[0] && percent[1] <= percent[0]);
    }
}

/// `omnivln rooms --places`: the floor is made from the places, furniture is filled on it, and it is cut as a plan is.
#[test]
#[ignore = "wants --release"]
fn the_rooms_of_places_by_the_floor_they_tell_of() {
    let Some(folder) = floor_plans() else { return };
    let mut means = Vec::new();
    for suffix in ["", "_furnitures"] {
        let mut scores = Vec::new();
        for name in names(&folder) {
            let file = places_file(&folder, &name, suffix);
            let place = |node: &Vec<f64>| Place { at: Point2::new(node[0], node[1]), clearance_m: node[2] };
            let places: Vec<Place> = file.nodes.iter().map(place).collect();
            let labels = rooms_of_places(&places, &file.edges, RESOLUTION_M, &RoomConfig::default()).unwrap();
            scores.push(score(&file.gt_room, &labels, 0));
            print_row(&format!("{name}{suffix}"), &scores[scores.len() - 1..]);
        }
        means.push(Score::mean(&scores));
    }
    print_row("**floor of the places: empty, furnished**", &means);
}
