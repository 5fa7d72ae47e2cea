//! What stands about on the floor or hangs on a wall.

use nalgebra::{Point3, Vector3};

use super::{Builder, DARK, Form, SKY, STEEL, TERRACOTTA};
use crate::colors::shade;
use crate::shape::Solid;

impl Builder {
    pub(super) fn hung(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Window => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), c);
                for (a, b) in [(-y + 0.05, -0.025), (0.025, y - 0.05)] {
                    self.span((x - 0.01, x), (a, b), (0.05, h - 0.05), SKY);
                }
            }
            Form::Radiator => {
                let fins = (self.w / 0.2).round().max(3.0) as usize;
                let step = self.w / fins as f64;
                for k in 0..fins {
                    let from = -y + step * k as f64;
                    let back = if k == 0 { -x } else { -x + 0.005 };
                    self.span((back, x), (from, from + step - 0.02 * f64::from(u8::from(k + 1 < fins))), (0.0, h), c);
                }
            }
            Form::Framed => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), DARK);
                self.span((x - 0.01, x), (-y + 0.02, y - 0.02), (0.02, h - 0.02), c);
            }
            Form::Disc => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), c);
                self.span((x - 0.01, x), (-0.01, 0.01), (h * 0.5, h * 0.88), DARK);
                self.span((x - 0.01, x), (-y * 0.55, 0.01), (h * 0.5 - 0.01, h * 0.5 + 0.01), DARK);
            }
            _ => {
                self.span((-x, x), (-y, y), (h - 0.02, h), STEEL);
                self.span((-x + 0.01, x - 0.005), (-y + 0.03, y - 0.03), (0.0, h - 0.02), c);
            }
        }
    }

    pub(super) fn loose(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Bin => {
                let base = Point3::origin();
                self.add(Solid::Round { base, radius_low_m: x * 0.8, radius_high_m: x, height_m: h - 0.01 }, c);
                let rim = Point3::new(0.0, 0.0, h - 0.01);
                self.add(
                    Solid::Round { base: rim, radius_low_m: x * 0.85, radius_high_m: x * 0.85, height_m: 0.01 },
                    DARK,
                );
            }
            Form::Plant => {
                let pot = 0.28 * h.min(1.1);
                self.add(
                    Solid::Round { base: Point3::origin(), radius_low_m: 0.11, radius_high_m: 0.16, height_m: pot },
                    TERRACOTTA,
                );
                self.add(Solid::post(0.0, 0.0, pot, 0.02, (h - pot) * 0.5), [90, 66, 40]);
                let leaf = (h - pot) * 0.36;
                let mid = pot + (h - pot) * 0.45;
                for (k, (dx, dy)) in [(0.45, 0.0), (-0.45, 0.0), (0.0, 0.45), (0.0, -0.45)].into_iter().enumerate() {
                    let center = Point3::new(dx * x, dy * y, mid + leaf * 0.12 * f64::from(k as u8));
                    self.add(
                        Solid::Lump { center, radii: Vector3::new(0.55 * x, 0.55 * y, leaf) },
                        shade(c, 0.9 + 0.06 * k as f64),
                    );
                }
                let crown = leaf.min(h - mid);
                self.add(
                    Solid::Lump {
                        center: Point3::new(0.0, 0.0, h - crown),
                        radii: Vector3::new(x * 0.7, y * 0.7, crown),
                    },
                    c,
                );
            }
            Form::FloorLamp => {
                self.add(Solid::post(0.0, 0.0, 0.0, 0.14, 0.03), DARK);
                self.add(Solid::post(0.0, 0.0, 0.03, 0.015, h - 0.33), DARK);
                let base = Point3::new(0.0, 0.0, h - 0.30);
                self.add(Solid::Round { base, radius_low_m: x, radius_high_m: x * 0.7, height_m: 0.30 }, c);
            }
            Form::Suitcase => {
                self.span((-x, x), (-y, y), (0.0, h - 0.05), c);
                self.span((-0.015, 0.015), (-y * 0.4, y * 0.4), (h - 0.05, h), DARK);
            }
            Form::Box => {
                self.whole(c);
            }
            Form::Vacuum => {
                self.span((0.0, x), (-y, y), (0.0, 0.08), DARK);
                self.span((-x, 0.06), (-y * 0.6, y * 0.6), (0.02, h * 0.55), c);
                self.span((-x, -x + 0.05), (-0.02, 0.02), (h * 0.55, h), DARK);
            }
            Form::Guitar => {
                self.add(Solid::block(0.0, 0.0, 0.0, self.d, 0.04, 0.06), DARK);
                self.span((-0.05, 0.05), (-y, y), (0.06, 0.34), c);
                self.span((-0.05, 0.05), (-y * 0.75, y * 0.75), (0.34, 0.54), c);
                self.span((-0.02, 0.02), (-0.03, 0.03), (0.54, h), shade(c, 0.5));
            }
            Form::Extinguisher => {
                self.add(Solid::post(0.0, 0.0, 0.0, x, h - 0.12), c);
                self.add(Solid::post(0.0, 0.0, h - 0.12, 0.03, 0.06), DARK);
                self.add(Solid::block(0.02, 0.0, h - 0.06, 0.10, 0.03, 0.06), DARK);
            }
            _ => {
                // Backpack: a lump with a pocket.
                self.add(
                    Solid::Lump { center: Point3::new(0.0, 0.0, h / 2.0), radii: Vector3::new(x * 0.85, y, h / 2.0) },
                    c,
                );
                self.span((x * 0.5, x), (-y * 0.6, y * 0.6), (0.06, h * 0.45), shade(c, 0.85));
            }
        }
    }
}
