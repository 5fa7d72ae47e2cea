//! The toolbox: ask a saved scene graph, record, read and map bags, align and fuse scans, find rooms in plans, run benches.

mod ask;
mod ask_plan;
mod barcode;
mod bench;
mod bench_latency;
mod bench_page;
mod bench_patrol;
mod bench_reg;
mod bench_tiers;
mod bench_tokens;
mod building_options;
mod dsg;
mod floor_of_places;
mod fuse;
mod json_lines;
mod judge;
mod local_model;
mod map;
mod memory;
mod nine_scenes;
mod odometry;
mod paper;
mod plan_air;
mod plan_ground;
mod problem_file;
mod prompt_reader;
mod record;
mod recording_args;
mod refer;
mod refer_page;
mod reg_lab;
mod reg_model;
mod register;
mod replay;
mod rooms;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Tools of the OmniVLN workspace. Progress goes to stderr; with --json, one JSON object goes to stdout.
#[derive(Debug, Parser)]
#[command(name = "omnivln", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Asks a saved scene graph where a thing is: rooms, candidates, prompt, reasoning, action
    Ask(ask::AskOptions),
    /// Fuses a folder of posed scans into a mesh, a distance field and places
    Fuse(fuse::FuseOptions),
    /// Makes a scene graph and a map of a recording, with odometry of its own
    Map(map::MapOptions),
    /// Aligns two scans: pose, inliers, time
    Register(register::RegisterOptions),
    /// Cuts a floor plan, or a graph of places, into rooms
    Rooms(rooms::RoomsOptions),
    /// The persistent homology of a graph: when its components are born and die
    Barcode(barcode::BarcodeOptions),
    /// Scene-graph files: what is in them, from and into spark_dsg, differences, faults, times
    #[command(subcommand)]
    Dsg(dsg::DsgCommand),
    /// Takes a simulated robot through a building and writes a bag of ROS 2 with masks, truth and tasks beside it
    Record(record::RecordOptions),
    /// Where the sensors of a recording were: LiDAR-inertial odometry, written as a TUM trajectory
    Odometry(odometry::OdometryOptions),
    /// Flies through corridors: certified trajectories, their cost and what they took
    PlanAir(plan_air::PlanAirOptions),
    /// Shortest ways between polygons
    PlanGround(plan_ground::PlanGroundOptions),
    /// Which objects sentences mean: the grounder on recorded rooms with labelled boxes, scored
    Refer(refer::ReferOptions),
    /// Runs the robot's side of a recorded run again, from its sensors alone, and compares the decisions
    Replay(replay::ReplayOptions),
    /// Judges a run again, from its truth/ alone
    Judge(judge::JudgeOptions),
    /// The experiments of the OmniVLN paper on this system, on one page beside the paper's figures
    Paper(paper::PaperOptions),
    /// Measures the whole system and its parts
    #[command(subcommand)]
    Bench(BenchCommand),
}

#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // there is one of it
enum BenchCommand {
    /// Many buildings and instructions, drawn from a seed, with the referee's verdicts
    Nav(bench::NavOptions),
    /// Hours of errands in one building: memory, times, lost tracks
    Patrol(bench_patrol::PatrolOptions),
    /// The same buildings seen with a rotating and with a fixed LiDAR: objects, directions and surface known
    Coverage(bench::CoverageOptions),
    /// The scene graph after a survey against the truth: objects, places, doorways, relations, groups, ids of rooms
    Map(bench::MapOptions),
    /// What a prompt costs on nine scenes, beside flat lists, and how it grows with the building
    Tokens(bench_tokens::TokensOptions),
    /// Whether a prompt says enough: right answers of readers that get nothing else
    Tiers(bench_tiers::TiersOptions),
    /// Descriptions of things in laboratories or recorded rooms: understood by the grounder, and true of the boxes
    Reg(bench_reg::RegOptions),
    /// Where the time of a decision goes: prompt, network, first token, answer, retries
    Latency(bench_latency::LatencyOptions),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Ask(options) => ask::run(&options),
        Command::Fuse(options) => fuse::run(&options),
        Command::Map(options) => map::run(&options),
        Command::Register(options) => register::run(&options),
        Command::Rooms(options) => rooms::run(&options),
        Command::Barcode(options) => barcode::run(&options),
        Command::Dsg(command) => dsg::run(&command),
        Command::Record(options) => record::run(&options),
        Command::Odometry(options) => odometry::run(&options),
        Command::PlanAir(options) => plan_air::run(&options),
        Command::PlanGround(options) => plan_ground::run(&options),
        Command::Paper(options) => paper::run(&options),
        Command::Bench(BenchCommand::Nav(options)) => bench::nav(&options),
        Command::Replay(options) => replay::run(&options),
        Command::Judge(options) => judge::run(&options),
        Command::Bench(BenchCommand::Patrol(options)) => bench_patrol::run(&options),
        Command::Bench(BenchCommand::Coverage(options)) => bench::coverage(&options),
        Command::Bench(BenchCommand::Map(options)) => bench::map(&options),
        Command::Bench(BenchCommand::Tokens(options)) => bench_tokens::run(&options),
        Command::Bench(BenchCommand::Tiers(options)) => bench_tiers::run(&options),
        Command::Bench(BenchCommand::Reg(options)) => bench_reg::run(&options),
        Command::Bench(BenchCommand::Latency(options)) => bench_latency::run(&options),
        Command::Refer(options) => refer::run(&options),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}
