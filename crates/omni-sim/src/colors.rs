//! Colour names and their colours.
//!
//! A thing's colour is drawn near the middle of its name's region and never leaves it: [`color_name`] of the drawn colour is
//! the name it was drawn for.

use rand::{Rng, RngExt};

/// Names with the middle of their region.
pub const COLORS: [(&str, [u8; 3]); 12] = [
    ("white", [238, 238, 235]),
    ("black", [32, 32, 34]),
    ("grey", [132, 134, 138]),
    ("red", [190, 36, 36]),
    ("orange", [235, 125, 30]),
    ("yellow", [240, 205, 50]),
    ("green", [55, 135, 60]),
    ("blue", [45, 85, 170]),
    ("purple", [115, 60, 140]),
    ("brown", [115, 75, 42]),
    ("beige", [208, 186, 146]),
    ("pink", [236, 140, 165]),
];

/// Largest change of one channel when a colour is drawn. Less than half of the smallest difference between two middles, which
/// keeps every drawn colour inside its region.
const SPREAD: i32 = 10;

/// The name whose middle is nearest (squared distance of the channels).
pub fn color_name(rgb: [u8; 3]) -> &'static str {
    let distance = |c: &[u8; 3]| (0..3).map(|k| (i32::from(c[k]) - i32::from(rgb[k])).pow(2)).sum::<i32>();
    COLORS.iter().min_by_key(|(_, c)| distance(c)).map_or("grey", |(name, _)| name)
}

/// A colour of this name; grey if there is no such name.
pub fn draw_color(rng: &mut impl Rng, name: &str) -> [u8; 3] {
    let middle = COLORS.iter().find(|(n, _)| *n == name).map_or([132, 134, 138], |(_, c)| *c);
    middle.map(|v| (i32::from(v) + rng.random_range(-SPREAD..=SPREAD)).clamp(0, 255) as u8)
}

/// The colour made darker (`factor` < 1) or lighter (> 1), for legs, handles and shadows.
pub fn shade(rgb: [u8; 3], factor: f64) -> [u8; 3] {
    rgb.map(|v| (f64::from(v) * factor).clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn every_drawn_color_keeps_its_name() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for (name, _) in COLORS {
            for _ in 0..500 {
                assert_eq!(color_name(draw_color(&mut rng, name)), name);
            }
        }
    }
}
