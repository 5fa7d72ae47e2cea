//! The command line that both robots share.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, ValueEnum};
use mission::px4::Px4Address;

use crate::flight_options::FlightOptions;

/// How the LiDAR is mounted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LidarMount {
    /// On a motor that turns about the vertical: sees all round, up and down.
    Rotating,
    /// The same sensor held still.
    Fixed,
}

/// Find a thing in a building nobody has seen before: the robot explores, maps, builds a scene graph, reasons, plans and goes there.
#[derive(Debug, Clone, Parser)]
#[command(version, max_term_width = 110)]
#[command(
    after_help = "Exit codes: 0 the robot stopped at the right place; 1 it stopped at the wrong place, gave up or was interrupted \
(the sentence says why); 2 bad usage or input.\n\nWhat remains of a run: its folder holds report.html for people, summary.json and \
decisions.jsonl for programs, the scene graph, the mesh, and truth/ with which anybody can judge the run again."
)]
pub struct Options {
    /// What to do, in English: "find the mug near the sink", "go to the kitchen, then find the plant"
    pub instruction: String,

    /// The building: a name (flat, office, corridor, narrow-door, spin), a number, the seed of a generated building, or a file: a floor
    /// plan (FILE.png, 5 cm a pixel, white is free; FILE.png#7 for other rooms of it, #7,5 for five of them, #7,shuffled or #7,uniform for other furniture), or a
    /// scene with named objects (.obj, .gltf, .glb)
    #[arg(long, value_name = "NAME|SEED|FILE")]
    pub scene: Option<String>,

    /// Seed of sensor noise, drift and start pose
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,

    /// Robot to use instead of the built-in one; FILE.toml beside it carries what URDF cannot (robots we know need none)
    #[arg(long, value_name = "FILE")]
    pub urdf: Option<PathBuf>,

    /// Run folder, by default runs/ROBOT-SCENE-SEED; an earlier run there is replaced once this one is complete
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Start with the scene graph and the map that an earlier run saved in DIR; without --start the robot finds out where in it it stands
    #[arg(long, value_name = "DIR")]
    pub known: Option<PathBuf>,

    /// Start pose in the map of --known: metres and degrees
    #[arg(long, value_name = "X,Y,Z,YAW", requires = "known", allow_hyphen_values = true, value_parser = parse_pose)]
    pub start: Option<Pose>,

    /// Base URL of an OpenAI-compatible server that reasons instead of the built-in reasoner, e.g. http://127.0.0.1:8091/v1
    #[arg(long, value_name = "BASE_URL", requires = "model")]
    pub llm: Option<String>,

    /// Name of the model on that server
    #[arg(long, value_name = "NAME", requires = "llm")]
    pub model: Option<String>,

    /// Base URL of an OpenAI-compatible server that looks at pictures: relations between near things are shown to it, e.g.
    /// http://127.0.0.1:8093/v1 (what is sent: documentation of mission::vision_verifier)
    #[arg(long, value_name = "BASE_URL", requires = "vlm_model")]
    pub vlm: Option<String>,

    /// Name of the model on that server
    #[arg(long, value_name = "NAME", requires = "vlm")]
    pub vlm_model: Option<String>,

    /// Address of a service that segments the pictures instead of the simulated segmenter, e.g. http://127.0.0.1:8092/segment
    /// (formats: documentation of mission::segmenter_http)
    #[arg(long, value_name = "URL")]
    pub segmenter: Option<String>,

    /// Other words for the names of things, a line each: "couch, settee = sofa"; they come on top of the built-in table
    #[arg(long, value_name = "FILE")]
    pub synonyms: Option<PathBuf>,

    /// Sensors and where they sit: a file (format: documentation of mission::rig), or one that ships with the program:
    /// rotating, fixed, fisheyes. Without it: what the robot's model says, and one panoramic camera
    #[arg(long, value_name = "FILE|NAME", conflicts_with = "lidar")]
    pub rig: Option<PathBuf>,

    /// Mount of the LiDAR
    #[arg(long, value_enum, default_value_t = LidarMount::Rotating)]
    pub lidar: LidarMount,

    /// An autopilot in place of the simulated body.
    #[cfg(feature = "px4")]
    #[command(flatten)]
    pub px4: Px4Options,

    /// Limits of an aircraft's flights.
    #[command(flatten)]
    pub flight: FlightOptions,

    /// A walking robot in place of the simulated body.
    #[cfg(feature = "unitree")]
    #[command(flatten)]
    pub unitree: UnitreeOptions,

    /// Where the robot may not be, or only slowly: a JSON file with polygons in metres from where it starts (x ahead, y left), or in
    /// the frame of the map of --known (format: documentation of mission::zones)
    #[arg(long, value_name = "FILE")]
    pub zones: Option<PathBuf>,

    /// Steer the run: a file of lines "12.5 pause", "20 resume", "31 find the plant in the office", "40 cancel" (seconds, then what
    /// to say), or - for lines without times from standard input. Without it a terminal is listened to: pause, resume, cancel, and
    /// any other line is a new instruction
    #[arg(long, value_name = "FILE")]
    pub commands: Option<PathBuf>,

    /// Somebody answers when the robot asks which of several things is meant: lines {"text": "find the mug", "answer": "the one near the
    /// sink"}. Without it who types at the terminal is asked, and where nobody does, it goes to any
    #[arg(long, value_name = "FILE")]
    pub answers: Option<PathBuf>,

    /// Keep what the sensors said (events.bin in the run folder, some 6 MB for a simulated second), for omnivln replay
    #[arg(long)]
    pub record: bool,

    /// So many people walk about in the building (0 to 10)
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(..=10))]
    pub people: u32,

    /// The people do not heed the robot
    #[arg(long, requires = "people")]
    pub heedless: bool,

    /// Give up after so many seconds of simulated time
    #[arg(long, default_value_t = 600.0, value_name = "SECONDS", value_parser = parse_positive, allow_negative_numbers = true)]
    pub max_time: f64,

    /// No progress, only the result
    #[arg(long)]
    pub quiet: bool,
}

/// The autopilot that flies.
#[derive(Debug, Clone, Args)]
pub struct Px4Options {
    /// Fly with a PX4 autopilot, in real time: udpout:HOST:PORT sends to it, udpin:HOST:PORT waits for it
    #[arg(long = "px4", value_name = "ADDRESS")]
    pub address: Option<Px4Address>,

    /// MAVLink system id of that autopilot
    #[arg(long = "px4-system", value_name = "ID", default_value_t = 1, requires = "address", value_parser = clap::value_parser!(u8).range(1..))]
    pub system_id: u8,

    /// Sign every frame, and demand signatures, with the key in FILE: 64 hexadecimal digits
    #[arg(long = "px4-key", value_name = "FILE", requires = "address")]
    pub key: Option<PathBuf>,
}

/// The robot that walks.
#[derive(Debug, Clone, Args)]
pub struct UnitreeOptions {
    /// Walk with a Unitree robot, in real time, that is at this network interface; lo for one on this machine
    #[arg(long = "unitree", value_name = "INTERFACE")]
    pub interface: Option<String>,

    /// DDS domain of that robot
    #[arg(long = "unitree-domain", value_name = "ID", default_value_t = 0, requires = "interface", value_parser = clap::value_parser!(u16).range(..=232))]
    pub domain: u16,
}

/// A pose on the command line: x, y, z in metres, yaw in degrees (turned into radians).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position.
    pub position_m: [f64; 3],
    /// Heading, counter-clockwise from x.
    pub yaw_rad: f64,
}

/// Reads `x,y,z,yaw` (metres, degrees).
pub fn parse_pose(text: &str) -> Result<Pose, String> {
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse::<f64>()).collect::<Result<_, _>>().map_err(|_| {
            format!("'{text}' is not four numbers x,y,z,yaw (metres and degrees), for example 1.0,2.5,0.3,90")
        })?;
    match numbers[..] {
        [x, y, z, yaw] if numbers.iter().all(|n| n.is_finite()) => {
            Ok(Pose { position_m: [x, y, z], yaw_rad: yaw.to_radians() })
        }
        _ => {
            Err(format!("'{text}' has {} numbers; x,y,z,yaw (metres and degrees) are four finite ones", numbers.len()))
        }
    }
}

pub(crate) fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("'{text}' is not a positive number of seconds")),
    }
}

impl Options {
    /// Files that the options name are meant from this folder on.
    pub fn settle_in(&mut self, folder: &std::path::Path) {
        let files = [
            &mut self.urdf,
            &mut self.known,
            &mut self.synonyms,
            &mut self.zones,
            &mut self.commands,
            &mut self.answers,
        ];
        for file in files.into_iter().flatten().filter(|file| file.as_os_str() != "-") {
            *file = folder.join(&*file);
        }
        // A rig may also be one of those that ship with the program.
        if let Some(rig) = self.rig.as_mut().filter(|rig| folder.join(&**rig).is_file()) {
            *rig = folder.join(&*rig);
        }
    }

    /// Checks what clap cannot, before anything is built.
    pub fn validate(&self) -> Result<()> {
        if self.instruction.trim().is_empty() {
            bail!("the instruction is empty; say for example \"find the mug near the sink\"");
        }
        const LONGEST: usize = 2000;
        if self.instruction.len() > LONGEST {
            bail!("the instruction has {} bytes; at most {LONGEST} are read", self.instruction.len());
        }
        if let Some(url) = &self.llm
            && !url.starts_with("http://")
        {
            bail!("--llm takes the address of a plain HTTP server such as http://127.0.0.1:8091/v1, not \"{url}\"");
        }
        if let Some(url) = &self.vlm
            && !url.starts_with("http://")
        {
            bail!("--vlm takes the address of a plain HTTP server such as http://127.0.0.1:8093/v1, not \"{url}\"");
        }
        if let Some(url) = &self.segmenter
            && !url.starts_with("http://")
        {
            bail!(
                "--segmenter takes the address of a plain HTTP service such as http://127.0.0.1:8092/segment, not \"{url}\""
            );
        }
        if let Some(urdf) = &self.urdf {
            std::fs::metadata(urdf).with_context(|| format!("reading the URDF {}", urdf.display()))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_read_or_refused_with_an_example() {
        let pose = parse_pose("1, -2,0.3,90").unwrap();
        assert_eq!(pose.position_m, [1.0, -2.0, 0.3]);
        assert!((pose.yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!(parse_pose("1,2,3").unwrap_err().contains("3 numbers"));
        assert!(parse_pose("1,2,x,4").unwrap_err().contains("for example"));
        assert!(parse_pose("1,2,NaN,4").is_err());
    }

    #[test]
    fn options_that_need_each_other_are_checked() {
        assert!(Options::try_parse_from(["ground", "find it", "--llm", "http://x"]).is_err());
        assert!(Options::try_parse_from(["ground", "find it", "--vlm", "http://x"]).is_err());
        assert!(Options::try_parse_from(["ground", "find it", "--vlm-model", "x"]).is_err());
        let other = Options::try_parse_from(["ground", "find it", "--vlm", "https://x", "--vlm-model", "y"]).unwrap();
        assert!(other.validate().unwrap_err().to_string().contains("--vlm takes"));
        assert!(Options::try_parse_from(["ground", "find it", "--max-time", "-3"]).is_err());
        let other = Options::try_parse_from(["ground", "find it", "--segmenter", "https://x"]).unwrap();
        assert!(other.validate().unwrap_err().to_string().contains("http://127.0.0.1:8092/segment"));
        let options = Options::try_parse_from(["ground", "find the mug"]).unwrap();
        assert_eq!(options.max_time, 600.0);
        options.validate().unwrap();
    }
}
