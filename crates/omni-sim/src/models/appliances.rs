//! What has water, power or a motor and stands on the floor.

use super::{Builder, DARK, Form, STEEL};
use crate::colors::shade;
use crate::shape::Solid;

impl Builder {
    pub(super) fn appliances(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Sink => {
                // A base cabinet whose top is a rim round a sunken basin, and a tap at the back.
                let tap = 0.22;
                let rim_top = h - tap;
                self.span((-x, x - 0.02), (-y, y), (0.0, rim_top - 0.18), shade(c, 0.9));
                self.span((-x, -x + 0.12), (-y, y), (rim_top - 0.18, rim_top), c);
                self.span((x - 0.07, x), (-y, y), (rim_top - 0.18, rim_top), c);
                self.span((-x + 0.12, x - 0.07), (-y, -y + 0.08), (rim_top - 0.18, rim_top), c);
                self.span((-x + 0.12, x - 0.07), (y - 0.08, y), (rim_top - 0.18, rim_top), c);
                self.add(Solid::post(-x + 0.07, 0.0, rim_top, 0.018, tap), STEEL);
                self.span((-x + 0.06, -x + 0.24), (-0.015, 0.015), (h - 0.03, h), STEEL);
            }
            Form::Stove => {
                self.span((-x, x - 0.02), (-y, y), (0.0, h - 0.02), c);
                self.span((x - 0.02, x), (-y + 0.04, y - 0.04), (0.15, 0.62), DARK);
                for s in [-0.2, -0.07, 0.07, 0.2] {
                    self.add(Solid::block(x - 0.01, s, 0.76, 0.02, 0.04, 0.04), STEEL);
                }
                for (sx, sy) in [(-0.13, -0.14), (-0.13, 0.14), (0.13, -0.14), (0.13, 0.14)] {
                    self.add(Solid::post(sx, sy, h - 0.02, 0.09, 0.02), DARK);
                }
            }
            Form::Fridge => {
                let split = h * 0.36;
                self.span((-x, x - 0.05), (-y, y), (0.0, h), shade(c, 0.92));
                self.span((x - 0.05, x - 0.03), (-y, y), (0.05, split - 0.005), c);
                self.span((x - 0.05, x - 0.03), (-y, y), (split + 0.005, h), c);
                self.span((x - 0.03, x), (y - 0.08, y - 0.05), (split + 0.15, split + 0.6), STEEL);
            }
            Form::Washer => {
                self.span((-x, x - 0.03), (-y, y), (0.0, h), c);
                self.span((x - 0.03, x - 0.015), (-0.19, 0.19), (0.22, 0.60), STEEL);
                self.span((x - 0.015, x), (-0.14, 0.14), (0.27, 0.55), DARK);
                self.span((x - 0.03, x - 0.01), (-y + 0.03, y - 0.03), (h - 0.12, h - 0.03), shade(c, 0.8));
                self.surface((-x, x - 0.03), (-y, y), h, 1.0);
            }
            Form::Toilet => {
                self.span((-x, -x + 0.18), (-y, y), (0.38, h), c);
                self.add(Solid::block(-0.02, 0.0, 0.0, self.d * 0.55, self.w * 0.55, 0.36), shade(c, 0.95));
                self.add(Solid::block(0.09, 0.0, 0.36, self.d - 0.18, self.w, 0.06), c);
            }
            Form::Bathtub => {
                let t = 0.07;
                self.span((-x, x), (-y, y), (0.0, 0.16), c);
                self.span((-x, -x + t), (-y, y), (0.16, h), c);
                self.span((x - t, x), (-y, y), (0.16, h), c);
                self.span((-x + t, x - t), (-y, -y + t), (0.16, h), c);
                self.span((-x + t, x - t), (y - t, y), (0.16, h), c);
            }
            Form::Copier => {
                self.span((-x, x - 0.02), (-y, y), (0.0, 0.80), c);
                for z in [0.12, 0.34, 0.56] {
                    self.span((x - 0.02, x), (-y + 0.04, y - 0.04), (z, z + 0.18), shade(c, 0.85));
                }
                self.span((-x, x - 0.06), (-y + 0.05, y - 0.05), (0.80, h - 0.10), DARK);
                self.span((-x, x - 0.02), (-y, y), (h - 0.10, h), shade(c, 1.05));
            }
            _ => {
                // Water dispenser: body, tap niche, bottle upside down.
                self.span((-x, x - 0.03), (-y, y), (0.0, h - 0.33), c);
                self.span((x - 0.03, x), (-0.06, 0.06), (0.62, 0.72), DARK);
                self.add(Solid::post(0.0, 0.0, h - 0.33, 0.13, 0.33), [120, 170, 215]);
            }
        }
    }
}
