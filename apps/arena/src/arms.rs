//! Arms of an experiment: one thing is varied, everything else stays, buildings, starts, sentences and noise included.

use anyhow::{Result, bail};
use mission::ablation::{Ablation, Part};
use mission::link::LinkConfig;
use mission::octant_prompt::PromptForm;
use mission::odometer::OdometrySource;

use crate::drift::DriftConfig;
use crate::run::RunConfig;

/// Field of view of `narrow`.
pub const NARROW_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// One thing that an experiment sets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setting {
    /// LiDAR and camera see 90 degrees ahead, or all round.
    IsNarrow(bool),
    /// The text of the prompt is a flat list, or ours.
    IsFlat(bool),
    /// The LiDAR's motor stands still, or turns.
    IsFixed(bool),
    /// A part of the method is left out.
    Without(Option<Part>),
    /// Factor on what the segmenter gets wrong.
    Noise(f64),
    /// In place of its own odometry the robot has true poses that drift: factor on half a per cent of the way and half a degree in 10 m.
    Drift(f64),
    /// Factor on the IMU's noise and biases.
    ImuNoise(f64),
    /// The model answers after so long, seconds (from, to).
    Latency(f64, f64),
    /// Share of calls that are lost.
    Loss(f64),
    /// Nobody can be reached from a time on, for so long (s).
    Outage(f64, f64),
}

/// A word of a list of two.
fn either(text: &str, usual: &str, other: &str) -> Result<bool, String> {
    match text {
        text if text == usual => Ok(false),
        text if text == other => Ok(true),
        _ => Err(format!("\"{text}\" is neither {usual} nor {other}")),
    }
}

fn factor(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| format!("\"{text}\" is not a number that is not negative"))
}

impl Setting {
    /// `omni` or `narrow`.
    pub fn sensing(text: &str) -> Result<Setting, String> {
        either(text, "omni", "narrow").map(Setting::IsNarrow)
    }

    /// `octant` or `flat`.
    pub fn prompt(text: &str) -> Result<Setting, String> {
        either(text, "octant", "flat").map(Setting::IsFlat)
    }

    /// `rotating` or `fixed`.
    pub fn lidar(text: &str) -> Result<Setting, String> {
        either(text, "rotating", "fixed").map(Setting::IsFixed)
    }

    /// The word of a [`Part`], or `none`.
    pub fn ablate(text: &str) -> Result<Setting, String> {
        if text == "none" {
            return Ok(Setting::Without(None));
        }
        let words = || Part::ALL.map(Part::word).join(", ");
        let part = Part::ALL.into_iter().find(|part| part.word() == text);
        part.map(|part| Setting::Without(Some(part))).ok_or_else(|| format!("\"{text}\" is none of none, {}", words()))
    }

    /// A factor.
    pub fn noise(text: &str) -> Result<Setting, String> {
        factor(text).map(Setting::Noise)
    }

    /// A factor.
    pub fn drift(text: &str) -> Result<Setting, String> {
        factor(text).map(Setting::Drift)
    }

    /// A factor.
    pub fn imu_noise(text: &str) -> Result<Setting, String> {
        factor(text).map(Setting::ImuNoise)
    }

    /// Seconds, or `FROM..TO`.
    pub fn latency(text: &str) -> Result<Setting, String> {
        let (from, to) = text.split_once("..").unwrap_or((text, text));
        let (from_s, to_s) = (factor(from)?, factor(to)?);
        if to_s < from_s {
            return Err(format!("\"{text}\" ends before it begins; it looks like 2 or 0.1..15 (seconds)"));
        }
        Ok(Setting::Latency(from_s, to_s))
    }

    /// A share from 0 to 1.
    pub fn loss(text: &str) -> Result<Setting, String> {
        let share = factor(text)?;
        if share <= 1.0 { Ok(Setting::Loss(share)) } else { Err(format!("\"{text}\" is no share from 0 to 1")) }
    }

    /// `AT+FOR`, seconds.
    pub fn outage(text: &str) -> Result<Setting, String> {
        let (at, length) = text
            .split_once('+')
            .ok_or_else(|| format!("\"{text}\" does not look like 20+60 (from second 20 on, for 60 s)"))?;
        Ok(Setting::Outage(factor(at)?, factor(length)?))
    }

    /// The option that sets it.
    pub fn option(&self) -> &'static str {
        match self {
            Setting::IsNarrow(_) => "sensing",
            Setting::IsFlat(_) => "prompt",
            Setting::IsFixed(_) => "lidar",
            Setting::Without(_) => "ablate",
            Setting::Noise(_) => "noise",
            Setting::Drift(_) => "drift",
            Setting::ImuNoise(_) => "imu-noise",
            Setting::Latency(..) => "llm-latency",
            Setting::Loss(_) => "llm-loss",
            Setting::Outage(..) => "llm-outage",
        }
    }

    /// What was written after the option.
    pub fn word(&self) -> String {
        let word = |is_other: bool, usual: &str, other: &str| if is_other { other } else { usual }.to_owned();
        match self {
            Setting::IsNarrow(is_narrow) => word(*is_narrow, "omni", "narrow"),
            Setting::IsFlat(is_flat) => word(*is_flat, "octant", "flat"),
            Setting::IsFixed(is_fixed) => word(*is_fixed, "rotating", "fixed"),
            Setting::Without(part) => part.map_or("none", Part::word).to_owned(),
            Setting::Noise(value) | Setting::Drift(value) | Setting::ImuNoise(value) | Setting::Loss(value) => {
                value.to_string()
            }
            Setting::Latency(from_s, to_s) if from_s == to_s => from_s.to_string(),
            Setting::Latency(from_s, to_s) => format!("{from_s}..{to_s}"),
            Setting::Outage(at_s, for_s) => format!("{at_s}+{for_s}"),
        }
    }

    /// Sets it on both sides.
    pub fn apply(&self, config: &mut RunConfig) {
        let link = |config: &mut RunConfig, set: &dyn Fn(&mut LinkConfig)| {
            set(config.mission.link.get_or_insert_with(LinkConfig::default));
        };
        match *self {
            Setting::IsNarrow(false) | Setting::IsFlat(false) | Setting::Without(None) => {}
            Setting::IsNarrow(true) => {
                config.simulation.view_rad = Some(NARROW_RAD);
                config.mission.view_rad = NARROW_RAD;
            }
            Setting::IsFlat(true) => config.mission.prompt.form = PromptForm::Flat,
            Setting::IsFixed(is_fixed) => config.simulation.is_lidar_fixed = is_fixed,
            Setting::Without(Some(part)) => config.mission.leave_out(Ablation::of(part)),
            Setting::Noise(factor) => config.simulation.segmenter.noise_scale = factor,
            Setting::Drift(factor) => {
                let usual = DriftConfig::default();
                config.mission.odometry = OdometrySource::Stream;
                config.simulation.drift = Some(DriftConfig {
                    yaw_rad_per_m: factor * usual.yaw_rad_per_m,
                    position_per_m: factor * usual.position_per_m,
                    ..usual
                });
            }
            Setting::ImuNoise(factor) => {
                let imu = &mut config.simulation.imu;
                let numbers = [
                    &mut imu.gyro_noise_density,
                    &mut imu.accel_noise_density,
                    &mut imu.gyro_bias_walk,
                    &mut imu.accel_bias_walk,
                    &mut imu.gyro_bias_start,
                    &mut imu.accel_bias_start,
                ];
                numbers.into_iter().for_each(|number| *number *= factor);
            }
            Setting::Latency(from_s, to_s) => link(config, &|link| link.latency_s = (from_s, to_s)),
            Setting::Loss(share) => link(config, &|link| link.loss = share),
            Setting::Outage(at_s, for_s) => link(config, &|link| link.outage_s = Some((at_s, for_s))),
        }
    }
}

/// What an experiment keeps and what it varies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Arms {
    /// The same in all arms.
    pub fixed: Vec<Setting>,
    /// One for each arm; the first is what the others are compared with. Empty for one arm.
    pub varied: Vec<Setting>,
}

impl Arms {
    /// From the options of a command line: one with several values is varied.
    ///
    /// # Errors
    /// Two such options.
    pub fn new(options: &[&[Setting]]) -> Result<Arms> {
        let mut arms = Arms::default();
        for settings in options {
            match settings {
                [] => {}
                [only] => arms.fixed.push(*only),
                several if arms.varied.is_empty() => arms.varied = several.to_vec(),
                several => bail!(
                    "--{} and --{} both have several values; an experiment varies one thing",
                    arms.varied[0].option(),
                    several[0].option()
                ),
            }
        }
        Ok(arms)
    }

    /// The configurations, one for each arm, with its name.
    pub fn configs(&self, base: &RunConfig) -> Vec<(String, RunConfig)> {
        let mut base = base.clone();
        self.fixed.iter().for_each(|setting| setting.apply(&mut base));
        let name = |settings: &[Setting]| {
            let words: Vec<String> = settings.iter().map(|s| format!("{} {}", s.option(), s.word())).collect();
            if words.is_empty() { "as it is".to_owned() } else { words.join(", ") }
        };
        if self.varied.is_empty() {
            return vec![(name(&self.fixed), base)];
        }
        self.varied
            .iter()
            .map(|setting| {
                let mut config = base.clone();
                setting.apply(&mut config);
                (setting.word(), config)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written_and_others_are_refused_with_what_is_accepted() {
        type Reader = fn(&str) -> Result<Setting, String>;
        let all: [(Reader, &[&str]); 10] = [
            (Setting::sensing, &["omni", "narrow"]),
            (Setting::prompt, &["octant", "flat"]),
            (Setting::lidar, &["rotating", "fixed"]),
            (Setting::ablate, &["none", "rooms", "pruning", "verify", "octants", "tiers", "steps", "critic", "vote"]),
            (Setting::noise, &["0", "2.5"]),
            (Setting::drift, &["1"]),
            (Setting::imu_noise, &["4"]),
            (Setting::latency, &["2", "0.1..15"]),
            (Setting::loss, &["0.2"]),
            (Setting::outage, &["20+60"]),
        ];
        for (read, words) in all {
            for word in words {
                assert_eq!(read(word).unwrap().word(), *word);
            }
            for wrong in ["", "x", "-1", "NaN", "9..1"] {
                assert!(read(wrong).is_err(), "{wrong}");
            }
        }
        assert!(Setting::loss("1.5").unwrap_err().contains("share"));
    }

    #[test]
    fn one_thing_is_varied() {
        let (narrow, omni) = (Setting::IsNarrow(true), Setting::IsNarrow(false));
        let noise = [Setting::Noise(2.0)];
        let arms = Arms::new(&[&[omni, narrow], &noise, &[]]).unwrap();
        let configs = arms.configs(&RunConfig::default());
        assert_eq!(configs.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["omni", "narrow"]);
        assert!(configs.iter().all(|(_, config)| config.simulation.segmenter.noise_scale == 2.0));
        assert_eq!(configs[0].1.simulation.view_rad, None);
        assert_eq!(configs[1].1.simulation.view_rad, Some(configs[1].1.mission.view_rad));
        let two = Arms::new(&[&[omni, narrow], &[Setting::Noise(1.0), Setting::Noise(2.0)]]);
        assert!(two.unwrap_err().to_string().contains("varies one thing"));
        assert_eq!(Arms::default().configs(&RunConfig::default()).len(), 1);
    }
}
