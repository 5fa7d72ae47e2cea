//! Whom the vision verifier asks about relations (Eq. 7), how often, and about what: all its numbers, with unit and reason.

use crate::error::MissionError;
use crate::openai::ChatConfig;
use crate::perspective_crop::CropConfig;

/// Whom to ask, how often, and about what.
#[derive(Debug, Clone, PartialEq)]
pub struct VisionConfig {
    /// The server. One request a question: what fails on the way is asked again later, from a newer picture.
    pub chat: ChatConfig,
    /// Size and opening of the picture.
    pub crop: CropConfig,
    /// Questions under way at a time, default 2.
    pub max_under_way: usize,
    /// Questions about one relation at most, however often its things move or the server fails; default 3.
    pub max_questions: u32,
    /// Geometric score from which a relation is worth a question, default 0.2. Below it is what geometry rejects clearly.
    pub plausible_score: f64,
    /// A thing that covers less of the panorama than this is not asked about, default 8 pixels.
    pub min_size_px: f64,
    /// An answer counts while no face of either box has moved this far, default 0.10 m.
    pub moved_m: f64,
    /// Failures in a row after which the server is left alone for 1 s, then 2, 4, ...; default 3.
    pub patience: u32,
    /// ... but at most for this long, default 60 s (of the sensors' time).
    pub longest_rest_s: f64,
}

impl VisionConfig {
    /// Defaults for a server (up to and including the version, `http://127.0.0.1:8091/v1`) and a model.
    pub fn new(base_url: &str, model: &str) -> VisionConfig {
        VisionConfig {
            chat: ChatConfig { attempts: 1, max_answer_tokens: 120, ..ChatConfig::new(base_url, model) },
            crop: CropConfig::default(),
            max_under_way: 2,
            max_questions: 3,
            plausible_score: 0.2,
            min_size_px: 8.0,
            moved_m: 0.10,
            patience: 3,
            longest_rest_s: 60.0,
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`MissionError::Config`] with the name of the first one that cannot be used.
    pub fn validate(&self) -> Result<(), MissionError> {
        const DAY_S: f64 = 86_400.0;
        let numbers = [
            ("vision.chat.timeout_s", self.chat.timeout_s, 0.01..=DAY_S, "seconds from 0.01 to a day"),
            ("vision.crop.side_px", f64::from(self.crop.side_px), 16.0..=2048.0, "16 to 2048"),
            ("vision.crop.margin", self.crop.margin, 0.0..=2.0, "0 to 2"),
            ("vision.crop.min_fov_rad", self.crop.min_fov_rad, 0.01..=3.0, "0.01 to 3 rad"),
            (
                "vision.crop.max_fov_rad",
                self.crop.max_fov_rad,
                self.crop.min_fov_rad.max(0.01)..=3.0,
                "at least the narrowest opening, at most 3 rad",
            ),
            ("vision.max_under_way", self.max_under_way as f64, 1.0..=64.0, "1 to 64"),
            ("vision.plausible_score", self.plausible_score, 0.0..=1.0, "0 to 1"),
            ("vision.min_size_px", self.min_size_px, 0.0..=1e4, "0 to 10000"),
            ("vision.moved_m", self.moved_m, 0.0..=1e3, "0 to 1000 m"),
            ("vision.longest_rest_s", self.longest_rest_s, 0.0..=DAY_S, "seconds up to a day"),
        ];
        match numbers.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((name, value, _, accepted)) => Err(MissionError::Config { name, value, accepted }),
            None => Ok(()),
        }
    }
}
