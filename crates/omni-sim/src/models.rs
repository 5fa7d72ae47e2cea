//! What each class looks like: a few solids, so that a building of twelve rooms stays within tens of thousands of triangles.
//!
//! Every builder fills the box `width x depth x height` it is given exactly: the bounds are the catalogue's size.

use nalgebra::{Point3, Vector3};

use crate::colors::shade;
use crate::shape::{Model, Part, Solid, Surface};

/// Families of shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Form {
    Chair,
    OfficeChair,
    Stool,
    Armchair,
    Bench,
    Table,
    Desk,
    Bench2,
    Counter,
    Shelf,
    Cabinet,
    Drawers,
    CoatRack,
    Sink,
    Stove,
    Fridge,
    Washer,
    Toilet,
    Bathtub,
    Bin,
    Bed,
    Copier,
    Dispenser,
    Plant,
    FloorLamp,
    Suitcase,
    Box,
    Vacuum,
    Guitar,
    Extinguisher,
    Window,
    Radiator,
    Framed,
    Disc,
    Towel,
    Screen,
    Laptop,
    Printer,
    TableLamp,
    Mug,
    Bottle,
    Bowl,
    Vase,
    Book,
    Kettle,
    Microwave,
    CoffeeMachine,
    Pillow,
    Backpack,
    Bear,
    Microscope,
}

const DARK: [u8; 3] = [45, 45, 48];
const STEEL: [u8; 3] = [165, 168, 172];
const PALE: [u8; 3] = [232, 230, 224];
const TERRACOTTA: [u8; 3] = [150, 92, 60];

/// The model of a form with these extents (width along y, depth along x) in this colour.
pub fn build(form: Form, width_m: f64, depth_m: f64, height_m: f64, rgb: [u8; 3]) -> Model {
    let mut b = Builder {
        w: width_m,
        d: depth_m,
        h: height_m,
        rgb,
        model: Model::default(),
    };
    b.furnish(form);
    b.model
}

struct Builder {
    w: f64,
    d: f64,
    h: f64,
    rgb: [u8; 3],
    model: Model,
}

impl Builder {
    fn add(&mut self, solid: Solid, rgb: [u8; 3]) {
        self.model.parts.push(Part { solid, rgb });
    }

    /// A block given by its bounds in x, y and z.
    fn span(&mut self, x: (f64, f64), y: (f64, f64), z: (f64, f64), rgb: [u8; 3]) {
        self.add(
            Solid::Block {
                min: Point3::new(x.0, y.0, z.0),
                max: Point3::new(x.1, y.1, z.1),
            },
            rgb,
        );
    }

    fn surface(&mut self, x: (f64, f64), y: (f64, f64), z: f64, headroom_m: f64) {
        self.model.surfaces.push(Surface {
            min: Point3::new(x.0, y.0, z),
            max: Point3::new(x.1, y.1, z),
            headroom_m,
        });
    }

    /// Half depth, half width.
    fn half(&self) -> (f64, f64) {
        (self.d / 2.0, self.w / 2.0)
    }

    fn whole(&mut self, rgb: [u8; 3]) {
        let ((x, y), h) = (self.half(), self.h);
        self.span((-x, x), (-y, y), (0.0, h), rgb);
    }

    fn legs(&mut self, height: f64, thick: f64, rgb: [u8; 3]) {
        let (x, y) = self.half();
        for (sx, sy) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let (cx, cy) = (sx * (x - thick / 2.0), sy * (y - thick / 2.0));
            self.add(Solid::block(cx, cy, 0.0, thick, thick, height), rgb);
        }
    }

    /// A top plate at full height on which things stand.
    fn top(&mut self, thick: f64, rgb: [u8; 3]) {
        let ((x, y), h) = (self.half(), self.h);
        self.span((-x, x), (-y, y), (h - thick, h), rgb);
        self.surface((-x, x), (-y, y), h, 1.2);
    }

    fn furnish(&mut self, form: Form) {
        match form {
            Form::Chair
            | Form::OfficeChair
            | Form::Stool
            | Form::Armchair
            | Form::Bench
            | Form::Bed => self.seats_and_beds(form),
            Form::Table
            | Form::Desk
            | Form::Bench2
            | Form::Counter
            | Form::Shelf
            | Form::Cabinet
            | Form::Drawers
            | Form::CoatRack => self.tables_and_storage(form),
            Form::Sink
            | Form::Stove
            | Form::Fridge
            | Form::Washer
            | Form::Toilet
            | Form::Bathtub
            | Form::Copier
            | Form::Dispenser => self.appliances(form),
            Form::Window | Form::Radiator | Form::Framed | Form::Disc | Form::Towel => {
                self.hung(form)
            }
            Form::Bin
            | Form::Plant
            | Form::FloorLamp
            | Form::Suitcase
            | Form::Box
            | Form::Vacuum
            | Form::Guitar
            | Form::Extinguisher
            | Form::Backpack => self.loose(form),
            _ => self.small(form),
        }
    }

    fn seats_and_beds(&mut self, form: Form) {
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
                self.span(
                    (-x + 0.03, x - 0.03),
                    (-y + 0.04, y - 0.04),
                    (0.42, 0.50),
                    c,
                );
                self.span((-x, -x + 0.07), (-y + 0.06, y - 0.06), (0.50, h), c);
                for s in [-1.0, 1.0] {
                    self.add(
                        Solid::block(0.0, s * (y - 0.02), 0.60, 0.30, 0.04, 0.04),
                        DARK,
                    );
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
                    let (a, b) = if s < 0.0 {
                        (-y, -y + arm)
                    } else {
                        (y - arm, y)
                    };
                    self.span((-x, x), (a, b), (0.28, 0.60), c);
                }
                let seats = (((self.w - 2.0 * arm) / 0.7).round() as usize).max(1);
                let step = (self.w - 2.0 * arm) / seats as f64;
                for k in 0..seats {
                    let from = -y + arm + step * k as f64;
                    self.span(
                        (-x + 0.22, x - 0.01),
                        (from + 0.01, from + step - 0.01),
                        (0.28, 0.44),
                        shade(c, 1.1),
                    );
                }
                self.legs(0.06, 0.06, DARK);
                self.surface(
                    (-x + 0.24, x - 0.02),
                    (-y + arm + 0.02, y - arm - 0.02),
                    0.44,
                    0.6,
                );
            }
            Form::Bench => {
                for s in [-1.0, 1.0] {
                    self.add(
                        Solid::block(0.0, s * (y - 0.05), 0.0, self.d - 0.04, 0.06, h - 0.05),
                        dark,
                    );
                }
                self.top(0.05, c);
            }
            _ => {
                // Bed: frame, headboard at the back, mattress, cover.
                self.span((-x, x), (-y, y), (0.10, 0.30), TERRACOTTA);
                self.legs(0.10, 0.08, DARK);
                self.span((-x, -x + 0.06), (-y, y), (0.30, h), TERRACOTTA);
                self.span(
                    (-x + 0.06, x - 0.02),
                    (-y + 0.02, y - 0.02),
                    (0.30, 0.48),
                    PALE,
                );
                self.span((-x + 0.60, x), (-y, y), (0.30, 0.52), c);
                self.surface((-x + 0.07, -x + 0.58), (-y + 0.05, y - 0.05), 0.48, 1.0);
            }
        }
    }

    fn tables_and_storage(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        let dark = shade(c, 0.8);
        match form {
            Form::Table => {
                self.legs(h - 0.04, 0.06, dark);
                self.top(0.04, c);
            }
            Form::Desk => {
                for s in [-1.0, 1.0] {
                    self.add(
                        Solid::block(0.0, s * (y - 0.02), 0.0, self.d - 0.04, 0.04, h - 0.03),
                        dark,
                    );
                }
                self.span(
                    (-x, -x + 0.03),
                    (-y + 0.04, y - 0.04),
                    (0.30, h - 0.03),
                    dark,
                );
                self.top(0.03, c);
            }
            Form::Bench2 => {
                self.legs(h - 0.05, 0.06, STEEL);
                self.span(
                    (-x + 0.02, x - 0.02),
                    (-y + 0.06, y - 0.06),
                    (0.20, 0.23),
                    STEEL,
                );
                self.top(0.05, c);
            }
            Form::Counter => {
                self.span((-x, x - 0.04), (-y, y), (0.0, 0.10), DARK);
                self.span((-x, x - 0.02), (-y, y), (0.10, h - 0.04), c);
                self.top(0.04, shade(c, 0.85));
            }
            Form::Shelf => {
                for s in [-1.0, 1.0] {
                    self.add(
                        Solid::block(0.0, s * (y - 0.0125), 0.0, self.d, 0.025, h),
                        c,
                    );
                }
                self.span((-x, -x + 0.012), (-y + 0.025, y - 0.025), (0.0, h), dark);
                let boards = 5;
                let step = (h - 0.10 - 0.025) / f64::from(boards - 1);
                for k in 0..boards {
                    let z = 0.08 + step * f64::from(k) - if k == boards - 1 { 0.0 } else { 0.0 };
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
                    self.span(
                        (x - 0.02, x),
                        (from + 0.004, from + step - 0.004),
                        (0.065, h - 0.004),
                        shade(c, 1.06),
                    );
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
                    self.span(
                        (x - 0.02, x - 0.005),
                        (-y + 0.01, y - 0.01),
                        (z, z + step - 0.012),
                        shade(c, 1.08),
                    );
                    self.span(
                        (x - 0.005, x),
                        (-0.06, 0.06),
                        (z + step * 0.5, z + step * 0.5 + 0.02),
                        STEEL,
                    );
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
                    Solid::Lump {
                        center: Point3::new(0.10, 0.0, h - 0.50),
                        radii: Vector3::new(0.10, 0.16, 0.34),
                    },
                    dark,
                );
            }
        }
    }

    fn appliances(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Sink => {
                // A base cabinet whose top is a rim round a sunken basin, and a tap at the back.
                let tap = 0.22;
                let rim_top = h - tap;
                self.span(
                    (-x, x - 0.02),
                    (-y, y),
                    (0.0, rim_top - 0.18),
                    shade(c, 0.9),
                );
                self.span((-x, -x + 0.12), (-y, y), (rim_top - 0.18, rim_top), c);
                self.span((x - 0.07, x), (-y, y), (rim_top - 0.18, rim_top), c);
                self.span(
                    (-x + 0.12, x - 0.07),
                    (-y, -y + 0.08),
                    (rim_top - 0.18, rim_top),
                    c,
                );
                self.span(
                    (-x + 0.12, x - 0.07),
                    (y - 0.08, y),
                    (rim_top - 0.18, rim_top),
                    c,
                );
                self.add(Solid::post(-x + 0.07, 0.0, rim_top, 0.018, tap), STEEL);
                self.span(
                    (-x + 0.06, -x + 0.24),
                    (-0.015, 0.015),
                    (h - 0.03, h),
                    STEEL,
                );
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
                self.span(
                    (x - 0.03, x),
                    (y - 0.08, y - 0.05),
                    (split + 0.15, split + 0.6),
                    STEEL,
                );
            }
            Form::Washer => {
                self.span((-x, x - 0.03), (-y, y), (0.0, h), c);
                self.span((x - 0.03, x - 0.015), (-0.19, 0.19), (0.22, 0.60), STEEL);
                self.span((x - 0.015, x), (-0.14, 0.14), (0.27, 0.55), DARK);
                self.span(
                    (x - 0.03, x - 0.01),
                    (-y + 0.03, y - 0.03),
                    (h - 0.12, h - 0.03),
                    shade(c, 0.8),
                );
                self.surface((-x, x - 0.03), (-y, y), h, 1.0);
            }
            Form::Toilet => {
                self.span((-x, -x + 0.18), (-y, y), (0.38, h), c);
                self.add(
                    Solid::block(-0.02, 0.0, 0.0, self.d * 0.55, self.w * 0.55, 0.36),
                    shade(c, 0.95),
                );
                self.add(
                    Solid::block(0.09, 0.0, 0.36, self.d - 0.18, self.w, 0.06),
                    c,
                );
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
                    self.span(
                        (x - 0.02, x),
                        (-y + 0.04, y - 0.04),
                        (z, z + 0.18),
                        shade(c, 0.85),
                    );
                }
                self.span(
                    (-x, x - 0.06),
                    (-y + 0.05, y - 0.05),
                    (0.80, h - 0.10),
                    DARK,
                );
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

    fn hung(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Window => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), PALE);
                for (a, b) in [(-y + 0.05, -0.025), (0.025, y - 0.05)] {
                    self.span((x - 0.01, x), (a, b), (0.05, h - 0.05), c);
                }
            }
            Form::Radiator => {
                let fins = (self.w / 0.2).round().max(3.0) as usize;
                let step = self.w / fins as f64;
                for k in 0..fins {
                    let from = -y + step * k as f64;
                    let back = if k == 0 { -x } else { -x + 0.005 };
                    self.span(
                        (back, x),
                        (from, from + step - 0.02 * f64::from(u8::from(k + 1 < fins))),
                        (0.0, h),
                        c,
                    );
                }
            }
            Form::Framed => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), DARK);
                self.span((x - 0.01, x), (-y + 0.02, y - 0.02), (0.02, h - 0.02), c);
            }
            Form::Disc => {
                self.span((-x, x - 0.01), (-y, y), (0.0, h), c);
                self.span((x - 0.01, x), (-0.01, 0.01), (h * 0.5, h * 0.88), DARK);
                self.span(
                    (x - 0.01, x),
                    (-y * 0.55, 0.01),
                    (h * 0.5 - 0.01, h * 0.5 + 0.01),
                    DARK,
                );
            }
            _ => {
                self.span((-x, x), (-y, y), (h - 0.02, h), STEEL);
                self.span(
                    (-x + 0.01, x - 0.005),
                    (-y + 0.03, y - 0.03),
                    (0.0, h - 0.02),
                    c,
                );
            }
        }
    }

    fn loose(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        match form {
            Form::Bin => {
                let base = Point3::origin();
                self.add(
                    Solid::Round {
                        base,
                        radius_low_m: x * 0.8,
                        radius_high_m: x,
                        height_m: h - 0.01,
                    },
                    c,
                );
                let rim = Point3::new(0.0, 0.0, h - 0.01);
                self.add(
                    Solid::Round {
                        base: rim,
                        radius_low_m: x * 0.85,
                        radius_high_m: x * 0.85,
                        height_m: 0.01,
                    },
                    DARK,
                );
            }
            Form::Plant => {
                let pot = 0.28 * h.min(1.1);
                self.add(
                    Solid::Round {
                        base: Point3::origin(),
                        radius_low_m: 0.11,
                        radius_high_m: 0.16,
                        height_m: pot,
                    },
                    TERRACOTTA,
                );
                self.add(
                    Solid::post(0.0, 0.0, pot, 0.02, (h - pot) * 0.5),
                    [90, 66, 40],
                );
                let leaf = (h - pot) * 0.36;
                let mid = pot + (h - pot) * 0.45;
                for (k, (dx, dy)) in [(0.45, 0.0), (-0.45, 0.0), (0.0, 0.45), (0.0, -0.45)]
                    .into_iter()
                    .enumerate()
                {
                    let center =
                        Point3::new(dx * x, dy * y, mid + leaf * 0.12 * f64::from(k as u8));
                    self.add(
                        Solid::Lump {
                            center,
                            radii: Vector3::new(0.55 * x, 0.55 * y, leaf),
                        },
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
                self.add(
                    Solid::Round {
                        base,
                        radius_low_m: x,
                        radius_high_m: x * 0.7,
                        height_m: 0.30,
                    },
                    c,
                );
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
                    Solid::Lump {
                        center: Point3::new(0.0, 0.0, h / 2.0),
                        radii: Vector3::new(x * 0.85, y, h / 2.0),
                    },
                    c,
                );
                self.span(
                    (x * 0.5, x),
                    (-y * 0.6, y * 0.6),
                    (0.06, h * 0.45),
                    shade(c, 0.85),
                );
            }
        }
    }

    fn small(&mut self, form: Form) {
        let ((x, y), h, c) = (self.half(), self.h, self.rgb);
        let ground = Point3::origin();
        match form {
            Form::Screen => {
                self.add(
                    Solid::block(0.0, 0.0, 0.0, self.d, self.w * 0.4, 0.015),
                    DARK,
                );
                self.add(Solid::block(-0.02, 0.0, 0.015, 0.03, 0.06, h * 0.35), DARK);
                self.span((-0.015, 0.025), (-y, y), (h * 0.2, h), c);
                self.span(
                    (0.025, 0.03),
                    (-y + 0.02, y - 0.02),
                    (h * 0.2 + 0.02, h - 0.02),
                    [28, 36, 48],
                );
            }
            Form::Laptop => {
                self.span((-x + 0.02, x), (-y, y), (0.0, 0.02), c);
                self.span((-x, -x + 0.02), (-y, y), (0.0, h), c);
                self.span(
                    (-x + 0.02, -x + 0.024),
                    (-y + 0.015, y - 0.015),
                    (0.04, h - 0.015),
                    [28, 36, 48],
                );
            }
            Form::Printer => {
                self.span((-x, x - 0.06), (-y, y), (0.0, h), c);
                self.span(
                    (x - 0.06, x),
                    (-y + 0.05, y - 0.05),
                    (0.04, 0.06),
                    shade(c, 0.8),
                );
            }
            Form::TableLamp => {
                self.add(Solid::post(0.0, 0.0, 0.0, x * 0.6, 0.02), DARK);
                self.add(Solid::post(0.0, 0.0, 0.02, 0.015, h - 0.2), DARK);
                let base = Point3::new(0.0, 0.0, h - 0.18);
                self.add(
                    Solid::Round {
                        base,
                        radius_low_m: x,
                        radius_high_m: x * 0.6,
                        height_m: 0.18,
                    },
                    c,
                );
            }
            Form::Mug => {
                // The body sits to the right of the footprint, the handle to the left.
                let r = x;
                self.add(Solid::post(0.0, -y + r, 0.0, r, h), c);
                self.span(
                    (-0.01, 0.01),
                    (-y + 2.0 * r - 0.005, y),
                    (h * 0.2, h * 0.8),
                    c,
                );
            }
            Form::Bottle => {
                self.add(Solid::post(0.0, 0.0, 0.0, x, h * 0.65), c);
                let base = Point3::new(0.0, 0.0, h * 0.65);
                self.add(
                    Solid::Round {
                        base,
                        radius_low_m: x * 0.8,
                        radius_high_m: x * 0.35,
                        height_m: h * 0.35,
                    },
                    c,
                );
            }
            Form::Bowl => {
                self.add(
                    Solid::Round {
                        base: ground,
                        radius_low_m: x * 0.5,
                        radius_high_m: x,
                        height_m: h,
                    },
                    c,
                );
            }
            Form::Vase => {
                self.add(
                    Solid::Round {
                        base: ground,
                        radius_low_m: x * 0.6,
                        radius_high_m: x,
                        height_m: h * 0.6,
                    },
                    c,
                );
                let neck = Point3::new(0.0, 0.0, h * 0.6);
                self.add(
                    Solid::Round {
                        base: neck,
                        radius_low_m: x,
                        radius_high_m: x * 0.5,
                        height_m: h * 0.4,
                    },
                    c,
                );
            }
            Form::Book => {
                self.span((-x, x), (-y, y), (0.0, h * 0.5), c);
                self.span((-x, x - 0.01), (-y + 0.01, y), (h * 0.5, h), shade(c, 0.8));
            }
            Form::Kettle => {
                self.add(
                    Solid::Round {
                        base: ground,
                        radius_low_m: x,
                        radius_high_m: x * 0.75,
                        height_m: h * 0.85,
                    },
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
                self.add(
                    Solid::Lump {
                        center: Point3::new(0.0, 0.0, h / 2.0),
                        radii: Vector3::new(x, y, h / 2.0),
                    },
                    c,
                );
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
