//! Chairs, sofas, beds, tables, shelves and cupboards.

use nalgebra::{Point3, Vector3};

use super::{Builder, DARK, Form, PALE, STEEL, TERRACOTTA};
use crate::colors::shade;
use crate::shape::Solid;

impl Builder {
    pub(super) fn seats_and_beds(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        let dark = shade(c, 0.8);
        match form {
            Form::Chair => {
                self.legs(0.43, 0.045, dark);
                self.span((-x, x), (-y, y), (0.43, 0.47), c);
                self.span((-x, -x + 0.04), (-y, y), (0.47, h), c);
            }
            Form::OfficeChair => {
                self.add(Solid::block(0.0, 0.0, 0.0, self.d, 0.08, 0.06), DARK);
                self.add(Solid::block(0.0, 0.0, 0.0, 0.08, self.w, 0.06), DARK);
                self.add(Solid::post(0.0, 0.0, 0.06, 0.03, 0.36), DARK);
                self.span((-x + 0.03, x - 0.03), (-y + 0.04, y - 0.04), (0.42, 0.50), c);
                self.span((-x, -x + 0.07), (-y + 0.06, y - 0.06), (0.50, h), c);
                for s in [-1.0, 1.0] {
                    self.add(Solid::block(0.0, s * (y - 0.02), 0.60, 0.30, 0.04, 0.04), DARK);
                }
            }
            Form::Stool => {
                self.legs(h - 0.04, 0.035, dark);
                self.top(0.04, c);
                self.model.surfaces.clear();
            }
            Form::Armchair => {
                // Sofa and armchair: base, back, two arms, cushions of 60 to 80 cm.
                let arm = if self.w > 1.2 { 0.18 } else { 0.13 };
                self.span((-x, x), (-y, y), (0.06, 0.28), dark);
                self.span((-x, -x + 0.22), (-y + arm, y - arm), (0.28, h), c);
                for s in [-1.0, 1.0] {
                    let (a, b) = if s < 0.0 { (-y, -y + arm) } else { (y - arm, y) };
                    self.span((-x, x), (a, b), (0.28, 0.60), c);
                }
                let seats = (((self.w - 2.0 * arm) / 0.7).round() as usize).max(1);
                let step = (self.w - 2.0 * arm) / seats as f64;
                for k in 0..seats {
                    let from = -y + arm + step * k as f64;
                    self.span((-x + 0.22, x - 0.01), (from + 0.01, from + step - 0.01), (0.28, 0.44), shade(c, 1.1));
                }
                self.legs(0.06, 0.06, DARK);
                self.surface((-x + 0.24, x - 0.02), (-y + arm + 0.02, y - arm - 0.02), 0.44, 0.6);
            }
            Form::Bench => {
                for s in [-1.0, 1.0] {
                    self.add(Solid::block(0.0, s * (y - 0.05), 0.0, self.d - 0.04, 0.06, h - 0.05), dark);
                }
                self.top(0.05, c);
            }
            _ => {
                // Bed: frame, headboard at the back, mattress, cover.
                self.span((-x, x), (-y, y), (0.10, 0.30), TERRACOTTA);
                self.legs(0.10, 0.08, DARK);
                self.span((-x, -x + 0.06), (-y, y), (0.30, h), TERRACOTTA);
                self.span((-x + 0.06, x - 0.02), (-y + 0.02, y - 0.02), (0.30, 0.48), PALE);
                self.span((-x + 0.60, x), (-y, y), (0.30, 0.52), c);
                self.surface((-x + 0.07, -x + 0.58), (-y + 0.05, y - 0.05), 0.48, 1.0);
            }
        }
    }

    pub(super) fn tables_and_storage(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        let dark = shade(c, 0.8);
        match form {
            Form::Table => {
                self.legs(h - 0.04, 0.06, dark);
                self.top(0.04, c);
            }
            Form::Desk => {
                for s in [-1.0, 1.0] {
                    self.add(Solid::block(0.0, s * (y - 0.02), 0.0, self.d - 0.04, 0.04, h - 0.03), dark);
                }
                self.span((-x, -x + 0.03), (-y + 0.04, y - 0.04), (0.30, h - 0.03), dark);
                self.top(0.03, c);
            }
            Form::Bench2 => {
                self.legs(h - 0.05, 0.06, STEEL);
                self.span((-x + 0.02, x - 0.02), (-y + 0.06, y - 0.06), (0.20, 0.23), STEEL);
                self.top(0.05, c);
            }
            Form::Counter => {
                self.span((-x, x - 0.04), (-y, y), (0.0, 0.10), DARK);
                self.span((-x, x - 0.02), (-y, y), (0.10, h - 0.04), c);
                self.top(0.04, shade(c, 0.85));
            }
            Form::Shelf => {
                for s in [-1.0, 1.0] {
                    self.add(Solid::block(0.0, s * (y - 0.0125), 0.0, self.d, 0.025, h), c);
                }
                self.span((-x, -x + 0.012), (-y + 0.025, y - 0.025), (0.0, h), dark);
                let boards = 5;
                let step = (h - 0.10 - 0.025) / f64::from(boards - 1);
                for k in 0..boards {
                    let z = 0.08 + step * f64::from(k);
                    let top = (z + 0.025).min(h);
                    self.span((-x + 0.012, x), (-y + 0.025, y - 0.025), (z, top), c);
                    let headroom = if k + 1 < boards { step - 0.035 } else { 0.0 };
                    if headroom > 0.0 && top < 1.35 {
                        self.surface((-x + 0.02, x), (-y + 0.03, y - 0.03), top, headroom);
                    }
                }
            }
            Form::Cabinet => {
                self.span((-x, x - 0.03), (-y, y), (0.0, 0.06), DARK);
                self.span((-x, x - 0.02), (-y, y), (0.06, h), c);
                let doors = (self.w / 0.5).round().max(1.0) as usize;
                let step = self.w / doors as f64;
                for k in 0..doors {
                    let from = -y + step * k as f64;
                    self.span((x - 0.02, x), (from + 0.004, from + step - 0.004), (0.065, h - 0.004), shade(c, 1.06));
                }
                if h < 1.35 {
                    self.surface((-x, x), (-y, y), h, 1.0);
                }
            }
            Form::Drawers => {
                self.span((-x, x - 0.02), (-y, y), (0.0, h), c);
                let drawers = (h / 0.24).round().max(2.0) as usize;
                let step = (h - 0.05) / drawers as f64;
                for k in 0..drawers {
                    let z = 0.05 + step * k as f64;
                    self.span((x - 0.02, x - 0.005), (-y + 0.01, y - 0.01), (z, z + step - 0.012), shade(c, 1.08));
                    self.span((x - 0.005, x), (-0.06, 0.06), (z + step * 0.5, z + step * 0.5 + 0.02), STEEL);
                }
                self.surface((-x, x - 0.02), (-y, y), h, 1.0);
            }
            _ => {
                // Coat rack: a pole with two crossed arms and a coat.
                self.add(Solid::block(0.0, 0.0, 0.0, self.d, 0.06, 0.04), c);
                self.add(Solid::block(0.0, 0.0, 0.0, 0.06, self.w, 0.04), c);
                self.add(Solid::post(0.0, 0.0, 0.04, 0.025, h - 0.04), c);
                self.add(Solid::block(0.0, 0.0, h - 0.12, 0.30, 0.03, 0.03), c);
                self.add(Solid::block(0.0, 0.0, h - 0.18, 0.03, 0.30, 0.03), c);
                self.add(
                    Solid::Lump { center: Point3::new(0.10, 0.0, h - 0.50), radii: Vector3::new(0.10, 0.16, 0.34) },
                    dark,
                );
            }
        }
    }
}
