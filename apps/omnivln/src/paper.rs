//! `omnivln paper`: the experiments of the paper on our own system, on one page, each table and figure beside the paper's.
//!
//! An experiment is a command of this program, run as printed under its figures ([`experiment`]); a section of the page reads what it prints. What is
//! done is kept in `DIR/data`, and taken from there by the same build.

mod experiment;
mod layout;
mod mapping;
mod navigation;
mod strip;
mod survey_pictures;
mod tables;
mod tier_pictures;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use arena::map_picture::escape;
use arena::whole_file::write_whole;
use clap::Args;

use experiment::Experiments;
use layout::{Section, command, page};

/// Options of `paper`.
#[derive(Debug, Args)]
pub struct PaperOptions {
    /// Folder of the page (index.html) and of what the experiments said (data/); work that was cut off goes on there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Base URL of an OpenAI-compatible server: what concerns a language model is measured with it, too
    #[arg(long, value_name = "URL")]
    llm: Option<String>,
    /// Name of the model on that server
    #[arg(long, value_name = "NAME", default_value = "default", requires = "llm")]
    model: String,
    /// So few cases that all is done in a quarter of an hour on two cores; without, it takes hours
    #[arg(long)]
    quick: bool,
    /// Floor plans and scenes of others for every second building: files or folders, as of bench nav
    #[arg(long, value_name = "PATH", num_args = 1..)]
    plans: Vec<PathBuf>,
    /// Only these sections, in a page named after them
    #[arg(long, value_name = "SECTION", value_delimiter = ',')]
    only: Vec<String>,
}

/// What sections are made from.
pub struct Paper {
    /// Folder of the page.
    pub out: PathBuf,
    /// How many cases.
    pub sizes: Sizes,
    /// Runs commands.
    experiments: Experiments,
    /// `--llm URL --model NAME`, if there is a model.
    model: Vec<String>,
    plans: Vec<PathBuf>,
}

/// How many cases of everything.
#[derive(Debug, Clone, PartialEq)]
pub struct Sizes {
    /// Buildings of seeds 1, 2, 3 for either robot.
    pub nav: Vec<usize>,
    /// The same, of buildings that were surveyed before.
    pub known: Vec<usize>,
    /// Buildings of every arm.
    pub arm: usize,
    /// Draws of each of D1 to D9.
    pub seeds: usize,
    /// Laboratories.
    pub labs: usize,
    /// Buildings surveyed with both mounts.
    pub coverage: usize,
    /// Decisions on the clock.
    pub decisions: usize,
    /// Every so many of the instructions.
    pub every_instruction: usize,
    /// Simulated hours.
    pub patrol_hours: f64,
}

impl Sizes {
    /// What the bars ask for.
    fn full() -> Sizes {
        Sizes {
            nav: vec![34, 33, 33],
            known: vec![34, 33, 33],
            arm: 30,
            seeds: 10,
            labs: 4,
            coverage: 10,
            decisions: 90,
            every_instruction: 1,
            patrol_hours: 2.0,
        }
    }

    /// What a quarter of an hour is enough for.
    fn quick() -> Sizes {
        Sizes {
            nav: vec![2],
            known: vec![1],
            arm: 2,
            seeds: 3,
            labs: 1,
            coverage: 1,
            decisions: 27,
            every_instruction: 15,
            patrol_hours: 0.02,
        }
    }
}

impl Paper {
    /// The command, printed as under a figure, that draws one section alone.
    fn own_command(&self, id: &str) -> String {
        let args = words("paper --only").into_iter().chain([id.to_owned(), "--out".to_owned()]);
        command(&args.chain([self.out.display().to_string()]).collect::<Vec<_>>())
    }

    fn has_model(&self) -> bool {
        !self.model.is_empty()
    }

    fn has_plans(&self) -> bool {
        !self.plans.is_empty()
    }

    /// Which buildings seed `at + 1` takes: with plans every second from them, else with furniture that differs from seed to seed.
    fn buildings(&self, at: usize) -> Vec<String> {
        const OURS: [&str; 3] = ["generated", "shuffled", "uniform"];
        if self.plans.is_empty() {
            return words(&format!("--buildings {}", OURS[at % OURS.len()]));
        }
        let mut args = words("--buildings mixed --plans");
        args.extend(self.plans.iter().map(|path| path.display().to_string()));
        args
    }
}

/// A text cut at its spaces.
fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

type Chapter = (&'static str, fn(&Paper) -> Result<Section>);

const CHAPTERS: [Chapter; 16] = [
    ("descriptions", tables::descriptions),
    ("tokens", tables::tokens),
    ("datasets", tables::by_dataset),
    ("latency", tables::latency),
    ("tiers", tier_pictures::section),
    ("perception", survey_pictures::perception),
    ("strip", strip::section),
    ("mounts", mapping::mounts),
    ("maps", survey_pictures::maps),
    ("system", navigation::whole_system),
    ("sensing", navigation::sensing),
    ("prompts", navigation::prompts),
    ("parts", navigation::ablations),
    ("far", navigation::far_away),
    ("instructions", navigation::instructions),
    ("patrol", mapping::patrol),
];

/// Runs what is not done yet and writes the page; it grows section by section.
pub fn run(options: &PaperOptions) -> Result<ExitCode> {
    for name in &options.only {
        let names: Vec<&str> = CHAPTERS.iter().map(|(id, _)| *id).collect();
        ensure!(names.contains(&name.as_str()), "--only {name}: there are {}", names.join(", "));
    }
    let mut model = Vec::new();
    if let Some(url) = &options.llm {
        model.extend(["--llm".to_owned(), url.clone(), "--model".to_owned(), options.model.clone()]);
    }
    let paper = Paper {
        experiments: Experiments::new(&options.out.join("data"))?,
        out: options.out.clone(),
        sizes: if options.quick { Sizes::quick() } else { Sizes::full() },
        model,
        plans: options.plans.clone(),
    };
    // Some sections alone never take the place of the whole page.
    let name = if options.only.is_empty() { "index".to_owned() } else { options.only.join("-") };
    let file = options.out.join(format!("{name}.html"));
    let (mut sections, mut missing) = (Vec::new(), 0);
    let chapters =
        CHAPTERS.iter().filter(|(id, _)| options.only.is_empty() || options.only.iter().any(|name| name == id));
    for (id, chapter) in chapters {
        eprintln!("-- {id}");
        sections.push(chapter(&paper).unwrap_or_else(|error| {
            eprintln!("   {error:#}");
            missing += 1;
            let body = format!("<p class=\"missing\">This is missing: {}</p>", escape(&format!("{error:#}")));
            Section { id, title: "Missing", body, claims: Vec::new() }
        }));
        write_whole(&file, |out| out.write_all(page(options.quick, &sections).as_bytes()))?;
    }
    arena::say!("{}", file.display());
    ensure!(missing == 0, "{missing} of the sections could not be made; the page says why");
    Ok(ExitCode::SUCCESS)
}
