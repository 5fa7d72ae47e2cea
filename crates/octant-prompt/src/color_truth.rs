//! Is a colour word true of a measured colour? By hue, saturation and value, with a wide doubtful border: people quarrel about turquoise,
//! and a lamp changes what a camera sees. Shares nothing with the grounder's distances between colours.

/// The words that are said.
pub const COLORS: [&str; 11] =
    ["black", "white", "gray", "red", "orange", "brown", "yellow", "green", "blue", "purple", "pink"];

/// Whether people would call `rgb` (0 to 255) by the word; None where they would not agree, and for words that are no colour here.
pub fn is_called(word: &str, rgb: &[f64; 3]) -> Option<bool> {
    let value = rgb[0].max(rgb[1]).max(rgb[2]);
    let chroma = value - rgb[0].min(rgb[1]).min(rgb[2]);
    let saturation = if value > 0.0 { chroma / value } else { 0.0 };
    let hue_deg = hue_deg(rgb, chroma, value);
    let (surely, perhaps) = match word {
        "black" => (value < 50.0, value < 90.0),
        "white" => (value > 200.0 && saturation < 0.12, value > 160.0 && saturation < 0.25),
        "gray" | "grey" => {
            (saturation < 0.1 && (80.0..170.0).contains(&value), saturation < 0.22 && (50.0..210.0).contains(&value))
        }
        "brown" => (
            saturation > 0.35 && (50.0..140.0).contains(&value) && within(hue_deg, 12.0, 38.0),
            saturation > 0.15 && value < 190.0 && within(hue_deg, 0.0, 50.0),
        ),
        _ => {
            let (core, wide) = match word {
                "red" => ((350.0, 8.0), (330.0, 22.0)),
                "orange" => ((20.0, 36.0), (8.0, 48.0)),
                "yellow" => ((48.0, 62.0), (38.0, 75.0)),
                "green" => ((85.0, 155.0), (65.0, 180.0)),
                "blue" => ((205.0, 245.0), (180.0, 265.0)),
                "purple" => ((265.0, 295.0), (245.0, 320.0)),
                "pink" => ((320.0, 345.0), (295.0, 360.0)),
                _ => return None,
            };
            // A dark orange is brown, a dark pink is red.
            let is_bright = !matches!(word, "orange" | "pink" | "yellow") || value > 150.0;
            (
                saturation > 0.45 && value > 70.0 && is_bright && within(hue_deg, core.0, core.1),
                saturation > 0.2 && value > 40.0 && within(hue_deg, wide.0, wide.1),
            )
        }
    };
    match (surely, perhaps) {
        (true, _) => Some(true),
        (false, true) => None,
        (false, false) => Some(false),
    }
}

/// Degrees in [0, 360), 0 for greys.
fn hue_deg(rgb: &[f64; 3], chroma: f64, value: f64) -> f64 {
    let [r, g, b] = *rgb;
    if chroma <= 0.0 {
        return 0.0;
    }
    let sixth = if value == r {
        ((g - b) / chroma).rem_euclid(6.0)
    } else if value == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    60.0 * sixth
}

/// On the arc that begins at `from` and goes up to `to`, through 0 if need be.
fn within(hue_deg: f64, from: f64, to: f64) -> bool {
    if from <= to { (from..=to).contains(&hue_deg) } else { hue_deg >= from || hue_deg <= to }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_colours_have_one_word_and_doubtful_ones_none() {
        let words = |rgb: [f64; 3]| -> Vec<&str> {
            COLORS.into_iter().filter(|word| is_called(word, &rgb) == Some(true)).collect()
        };
        assert_eq!(words([200.0, 20.0, 20.0]), ["red"]);
        assert_eq!(words([90.0, 60.0, 30.0]), ["brown"]);
        assert_eq!(words([30.0, 60.0, 200.0]), ["blue"]);
        assert_eq!(words([230.0, 230.0, 225.0]), ["white"]);
        assert_eq!(words([20.0, 22.0, 21.0]), ["black"]);
        assert_eq!(words([40.0, 160.0, 170.0]), Vec::<&str>::new(), "between green and blue");
        assert_eq!(is_called("green", &[200.0, 20.0, 20.0]), Some(false));
        assert_eq!(is_called("zorgle", &[0.0; 3]), None);
    }

    #[test]
    fn nothing_is_surely_two_things() {
        for r in (0..=255).step_by(15) {
            for g in (0..=255).step_by(15) {
                for b in (0..=255).step_by(15) {
                    let rgb = [f64::from(r), f64::from(g), f64::from(b)];
                    let count = COLORS.into_iter().filter(|word| is_called(word, &rgb) == Some(true)).count();
                    assert!(count <= 1, "{rgb:?}");
                }
            }
        }
    }
}
