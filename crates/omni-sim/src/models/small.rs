//! What stands on furniture.

use nalgebra::{Point3, Vector3};

use super::{Builder, DARK, Form};
use crate::colors::shade;
use crate::shape::Solid;

impl Builder {
    pub(super) fn small(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        let ground = Point3::origin();
        match form {
            Form::Screen => {
                self.add(Solid::block(0.0, 0.0, 0.0, self.d, self.w * 0.4, 0.015), DARK);
                self.add(Solid::block(-0.02, 0.0, 0.015, 0.03, 0.06, h * 0.35), DARK);
                self.span((-0.015, 0.025), (-y, y), (h * 0.2, h), c);
                self.span((0.025, 0.03), (-y + 0.02, y - 0.02), (h * 0.2 + 0.02, h - 0.02), [28, 36, 48]);
            }
            Form::Laptop => {
                self.span((-x + 0.02, x), (-y, y), (0.0, 0.02), c);
                self.span((-x, -x + 0.02), (-y, y), (0.0, h), c);
                self.span((-x + 0.02, -x + 0.024), (-y + 0.015, y - 0.015), (0.04, h - 0.015), [28, 36, 48]);
            }
            Form::Printer => {
                self.span((-x, x - 0.06), (-y, y), (0.0, h), c);
                self.span((x - 0.06, x), (-y + 0.05, y - 0.05), (0.04, 0.06), shade(c, 0.8));
            }
            Form::TableLamp => {
                self.add(Solid::post(0.0, 0.0, 0.0, x * 0.6, 0.02), DARK);
                self.add(Solid::post(0.0, 0.0, 0.02, 0.015, h - 0.2), DARK);
                let base = Point3::new(0.0, 0.0, h - 0.18);
                self.add(Solid::Round { base, radius_low_m: x, radius_high_m: x * 0.6, height_m: 0.18 }, c);
            }
            Form::Mug => {
                // The body sits to the right of the footprint, the handle to the left.
                let r = x;
                self.add(Solid::post(0.0, -y + r, 0.0, r, h), c);
                self.span((-0.01, 0.01), (-y + 2.0 * r - 0.005, y), (h * 0.2, h * 0.8), c);
            }
            Form::Bottle => {
                self.add(Solid::post(0.0, 0.0, 0.0, x, h * 0.65), c);
                let base = Point3::new(0.0, 0.0, h * 0.65);
                self.add(Solid::Round { base, radius_low_m: x * 0.8, radius_high_m: x * 0.35, height_m: h * 0.35 }, c);
            }
            Form::Bowl => {
                self.add(Solid::Round { base: ground, radius_low_m: x * 0.5, radius_high_m: x, height_m: h }, c);
            }
            Form::Vase => {
                self.add(Solid::Round { base: ground, radius_low_m: x * 0.6, radius_high_m: x, height_m: h * 0.6 }, c);
                let neck = Point3::new(0.0, 0.0, h * 0.6);
                self.add(Solid::Round { base: neck, radius_low_m: x, radius_high_m: x * 0.5, height_m: h * 0.4 }, c);
            }
            Form::Book => {
                self.span((-x, x), (-y, y), (0.0, h * 0.5), c);
                self.span((-x, x - 0.01), (-y + 0.01, y), (h * 0.5, h), shade(c, 0.8));
            }
            Form::Kettle => {
                self.add(
                    Solid::Round { base: ground, radius_low_m: x, radius_high_m: x * 0.75, height_m: h * 0.85 },
                    c,
                );
                self.add(Solid::post(0.0, 0.0, h * 0.85, 0.02, h * 0.15), DARK);
                self.span((-0.012, 0.012), (x * 0.7, y), (h * 0.15, h * 0.75), DARK);
                self.span((-0.015, 0.015), (-y, -x * 0.7), (h * 0.55, h * 0.7), c);
            }
            Form::Microwave => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), c);
                self.span((x - 0.01, x), (-y + 0.02, y - 0.12), (0.03, h - 0.03), DARK);
            }
            Form::CoffeeMachine => {
                self.span((-x, x), (-y, y), (0.0, 0.05), DARK);
                self.span((-x, -x + self.d * 0.45), (-y, y), (0.05, h), c);
                self.span((-x + self.d * 0.45, x - 0.02), (-y, y), (h * 0.66, h), c);
            }
            Form::Pillow => {
                self.add(Solid::Lump { center: Point3::new(0.0, 0.0, h / 2.0), radii: Vector3::new(x, y, h / 2.0) }, c);
            }
            Form::Bear => {
                self.add(
                    Solid::Lump {
                        center: Point3::new(0.0, 0.0, h * 0.3),
                        radii: Vector3::new(x * 0.9, y * 0.75, h * 0.3),
                    },
                    c,
                );
                self.add(
                    Solid::Lump {
                        center: Point3::new(0.0, 0.0, h * 0.78),
                        radii: Vector3::new(x * 0.7, y * 0.6, h * 0.22),
                    },
                    c,
                );
                self.add(Solid::block(x * 0.75, 0.0, 0.0, x * 0.5, self.w, 0.08), c);
            }
            Form::Microscope => {
                self.span((-x, x), (-y, y), (0.0, 0.04), DARK);
                self.span((-x, -x + 0.06), (-0.04, 0.04), (0.04, h * 0.75), c);
                self.span((-x, x * 0.4), (-0.05, 0.05), (h * 0.75, h * 0.88), c);
                self.add(Solid::post(x * 0.2, 0.0, h * 0.3, 0.025, h * 0.45), DARK);
                self.add(Solid::post(-x * 0.4, 0.0, h * 0.88, 0.025, h * 0.12), DARK);
            }
            _ => self.whole(c),
        }
    }
}
