//! What each class looks like: a few solids, so that a building of twelve rooms stays within tens of thousands of triangles.
//!
//! Every builder fills the box `width x depth x height` it is given exactly: the bounds are the catalogue's size.

mod appliances;
mod loose_and_hung;
mod seats_and_storage;
mod small;

use nalgebra::Point3;

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

/// Daylight behind a pane: still nearest to white among the colour names.
const SKY: [u8; 3] = [206, 222, 236];
const DARK: [u8; 3] = [45, 45, 48];
const STEEL: [u8; 3] = [165, 168, 172];
const PALE: [u8; 3] = [232, 230, 224];
const TERRACOTTA: [u8; 3] = [150, 92, 60];

/// The model of a form with these extents (width along y, depth along x) in this colour.
pub fn build(form: Form, width_m: f64, depth_m: f64, height_m: f64, rgb: [u8; 3]) -> Model {
    let mut b = Builder { w: width_m, d: depth_m, h: height_m, rgb, model: Model::default() };
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
        self.add(Solid::Block { min: Point3::new(x.0, y.0, z.0), max: Point3::new(x.1, y.1, z.1) }, rgb);
    }

    fn surface(&mut self, x: (f64, f64), y: (f64, f64), z: f64, headroom_m: f64) {
        self.model.surfaces.push(Surface { min: Point3::new(x.0, y.0, z), max: Point3::new(x.1, y.1, z), headroom_m });
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
            Form::Chair | Form::OfficeChair | Form::Stool | Form::Armchair | Form::Bench | Form::Bed => {
                self.seats_and_beds(form)
            }
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
            Form::Window | Form::Radiator | Form::Framed | Form::Disc | Form::Towel => self.hung(form),
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
}
