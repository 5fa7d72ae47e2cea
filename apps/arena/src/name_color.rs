//! The colour in which a name is drawn: the same in every picture and every run.

/// Red, green and blue of a name: its hash chooses the hue.
pub fn name_color(name: &str) -> [u8; 3] {
    // FNV-1a
    let hash = name.bytes().fold(0x811C_9DC5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    let hue = 6.0 * f64::from(hash >> 8) / f64::from(1_u32 << 24);
    [0.0, 4.0, 2.0].map(|shift| {
        let ramp = ((hue + shift).rem_euclid(6.0) - 3.0).abs() - 1.0;
        (90.0 + 140.0 * ramp.clamp(0.0, 1.0)) as u8
    })
}
