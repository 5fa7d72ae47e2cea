//! The catalogue of classes: sizes, colours, materials, functions, and what each is mistaken for.
//!
//! Names are the ones an open-vocabulary segmenter would use. Sizes are usual ones of the trade, width along the wall, depth
//! away from it.

use crate::models::Form;

/// How a thing is fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mount {
    /// Stands on the floor.
    Floor,
    /// Stands on other furniture.
    Top,
    /// Hangs on a wall with its lower edge at this height, metres.
    Wall(f64),
}

/// Which sides must stay reachable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// The front.
    Front,
    /// Any side will do.
    Any,
}

/// A class of things.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Class {
    /// Name, singular, lower case.
    pub name: &'static str,
    /// Shape family.
    pub form: Form,
    /// Width, depth, height: smallest and largest, metres.
    pub size_m: [(f64, f64); 3],
    /// How it is fixed.
    pub mount: Mount,
    /// Sides to be kept free.
    pub usable: Use,
    /// Usual colours, by name.
    pub colors: &'static [&'static str],
    /// Usual materials.
    pub materials: &'static [&'static str],
    /// What it is for: completes "used for ...".
    pub function: &'static str,
    /// Classes it is confused with.
    pub look_alikes: &'static [&'static str],
}

/// The class of this name.
pub fn class(name: &str) -> Option<&'static Class> {
    CLASSES.iter().find(|c| c.name == name)
}

/// True if people may call a thing of this class by `noun`: its name or the name's last word (`"chair"` for an
/// `"office chair"`).
pub fn may_be_called(class: &str, noun: &str) -> bool {
    class == noun || class.rsplit(' ').next() == Some(noun)
}

const WOODS: &[&str] = &["brown", "beige", "white", "black"];
const CLOTHS: &[&str] = &["grey", "blue", "red", "green", "beige", "brown", "orange", "purple"];
const BRIGHT: &[&str] = &["white", "red", "blue", "green", "yellow", "orange", "black", "pink"];
const TECH: &[&str] = &["black", "grey", "white"];
const WOOD: &[&str] = &["wood", "oak", "pine"];
const BOARD: &[&str] = &["wood", "chipboard", "laminate"];
const FABRIC: &[&str] = &["fabric", "leather", "velvet"];
const PLASTIC: &[&str] = &["plastic"];
const METAL: &[&str] = &["metal", "steel"];
const CERAMIC: &[&str] = &["ceramic", "porcelain"];

#[allow(clippy::too_many_arguments)]
const fn row(
    name: &'static str,
    form: Form,
    size_m: [(f64, f64); 3],
    mount: Mount,
    usable: Use,
    colors: &'static [&'static str],
    materials: &'static [&'static str],
    function: &'static str,
    look_alikes: &'static [&'static str],
) -> Class {
    Class { name, form, size_m, mount, usable, colors, materials, function, look_alikes }
}

use Mount::{Floor, Top, Wall};
use Use::{Any, Front};

/// All classes, furniture first.
#[rustfmt::skip]
pub const CLASSES: &[Class] = &[
    // Seats
    row("chair", Form::Chair, [(0.42, 0.48), (0.44, 0.50), (0.82, 0.92)], Floor, Any, BRIGHT, &["wood", "plastic"], "sitting at a table", &["office chair", "stool"]),
    row("office chair", Form::OfficeChair, [(0.54, 0.60), (0.54, 0.60), (0.90, 1.05)], Floor, Any, &["black", "grey", "blue", "red", "green"], &["fabric", "mesh"], "sitting at a desk", &["chair", "armchair"]),
    row("stool", Form::Stool, [(0.34, 0.40), (0.34, 0.40), (0.45, 0.65)], Floor, Any, BRIGHT, &["wood", "metal"], "sitting for a short while", &["chair", "side table"]),
    row("armchair", Form::Armchair, [(0.78, 0.90), (0.78, 0.88), (0.78, 0.92)], Floor, Front, CLOTHS, FABRIC, "sitting comfortably", &["sofa", "office chair"]),
    row("sofa", Form::Armchair, [(1.60, 2.20), (0.82, 0.95), (0.75, 0.88)], Floor, Front, CLOTHS, FABRIC, "sitting together", &["armchair", "bed"]),
    row("bench", Form::Bench, [(0.90, 1.30), (0.36, 0.42), (0.44, 0.48)], Floor, Front, WOODS, WOOD, "sitting while waiting", &["coffee table", "shoe cabinet"]),
    // Tables
    row("dining table", Form::Table, [(1.40, 1.80), (0.80, 0.95), (0.73, 0.76)], Floor, Any, WOODS, WOOD, "eating meals", &["desk", "conference table"]),
    row("kitchen table", Form::Table, [(0.80, 1.10), (0.62, 0.74), (0.73, 0.76)], Floor, Any, WOODS, WOOD, "having breakfast", &["dining table", "desk"]),
    row("coffee table", Form::Table, [(0.80, 1.10), (0.45, 0.60), (0.38, 0.46)], Floor, Any, WOODS, &["wood", "glass", "metal"], "putting down cups and magazines", &["bench", "side table"]),
    row("side table", Form::Table, [(0.42, 0.50), (0.40, 0.46), (0.50, 0.60)], Floor, Any, WOODS, &["wood", "metal"], "keeping small things at hand", &["stool", "nightstand"]),
    row("conference table", Form::Table, [(2.00, 2.60), (0.85, 1.00), (0.73, 0.76)], Floor, Any, WOODS, BOARD, "holding meetings", &["dining table", "workbench"]),
    row("desk", Form::Desk, [(1.20, 1.60), (0.65, 0.78), (0.72, 0.76)], Floor, Front, WOODS, BOARD, "working and writing", &["dining table", "workbench"]),
    row("workbench", Form::Bench2, [(1.50, 2.10), (0.68, 0.78), (0.88, 0.92)], Floor, Front, &["white", "grey", "beige", "blue"], &["steel", "laminate"], "doing experiments", &["desk", "counter"]),
    row("console table", Form::Table, [(0.80, 1.10), (0.30, 0.36), (0.74, 0.82)], Floor, Front, WOODS, WOOD, "dropping keys and letters", &["side table", "desk"]),
    row("reception desk", Form::Counter, [(1.60, 2.20), (0.65, 0.75), (1.02, 1.08)], Floor, Any, WOODS, BOARD, "welcoming visitors", &["counter", "desk"]),
    row("ironing board", Form::Table, [(1.10, 1.25), (0.36, 0.42), (0.82, 0.90)], Floor, Any, &["blue", "grey", "green", "pink"], &["fabric", "metal"], "ironing clothes", &["bench", "console table"]),
    // Storage
    row("bookshelf", Form::Shelf, [(0.80, 1.20), (0.28, 0.36), (1.70, 2.05)], Floor, Front, WOODS, WOOD, "keeping books", &["storage rack", "cabinet"]),
    row("storage rack", Form::Shelf, [(0.90, 1.30), (0.38, 0.48), (1.70, 2.00)], Floor, Front, &["grey", "black", "blue", "orange"], METAL, "storing boxes and supplies", &["bookshelf", "cabinet"]),
    row("cabinet", Form::Cabinet, [(0.80, 1.20), (0.40, 0.48), (1.20, 1.80)], Floor, Front, &["white", "grey", "brown", "green", "beige"], &["wood", "metal"], "keeping things behind doors", &["wardrobe", "filing cabinet"]),
    row("wardrobe", Form::Cabinet, [(1.20, 1.90), (0.58, 0.64), (1.95, 2.15)], Floor, Front, WOODS, BOARD, "hanging clothes", &["cabinet", "fridge"]),
    row("dresser", Form::Drawers, [(0.80, 1.20), (0.42, 0.50), (0.78, 0.95)], Floor, Front, WOODS, WOOD, "folding away clothes", &["sideboard", "cabinet"]),
    row("nightstand", Form::Drawers, [(0.40, 0.50), (0.38, 0.44), (0.48, 0.58)], Floor, Any, WOODS, WOOD, "keeping things beside the bed", &["side table", "filing cabinet"]),
    row("sideboard", Form::Cabinet, [(1.20, 1.70), (0.42, 0.48), (0.78, 0.88)], Floor, Front, WOODS, WOOD, "storing dishes and table linen", &["dresser", "tv stand"]),
    row("tv stand", Form::Cabinet, [(1.20, 1.60), (0.38, 0.45), (0.45, 0.55)], Floor, Front, WOODS, BOARD, "carrying the television", &["sideboard", "bench"]),
    row("filing cabinet", Form::Drawers, [(0.42, 0.48), (0.55, 0.62), (0.70, 1.05)], Floor, Front, &["grey", "white", "black", "beige"], METAL, "filing papers", &["nightstand", "cabinet"]),
    row("shoe cabinet", Form::Cabinet, [(0.70, 1.00), (0.28, 0.34), (0.75, 0.95)], Floor, Front, WOODS, BOARD, "putting away shoes", &["dresser", "cabinet"]),
    row("coat rack", Form::CoatRack, [(0.40, 0.50), (0.40, 0.50), (1.60, 1.80)], Floor, Any, WOODS, &["wood", "metal"], "hanging coats", &["floor lamp", "plant"]),
    // Kitchen
    row("counter", Form::Counter, [(0.60, 1.00), (0.60, 0.62), (0.90, 0.90)], Floor, Front, &["white", "grey", "beige", "brown"], &["wood", "stone", "laminate"], "preparing food", &["cabinet", "workbench"]),
    row("sink", Form::Sink, [(0.70, 0.85), (0.60, 0.62), (1.12, 1.12)], Floor, Front, &["grey", "white"], &["steel", "ceramic"], "washing hands and dishes", &["counter", "bathtub"]),
    row("stove", Form::Stove, [(0.60, 0.60), (0.60, 0.62), (0.90, 0.90)], Floor, Front, &["white", "black", "grey"], &["steel", "enamel"], "cooking", &["counter", "washing machine"]),
    row("fridge", Form::Fridge, [(0.60, 0.72), (0.62, 0.68), (1.65, 1.90)], Floor, Front, &["white", "grey", "red", "black"], &["steel", "plastic"], "keeping food cold", &["wardrobe", "vending machine"]),
    row("dishwasher", Form::Washer, [(0.60, 0.60), (0.58, 0.60), (0.85, 0.88)], Floor, Front, &["white", "grey"], METAL, "washing dishes", &["washing machine", "stove"]),
    // Bathroom and laundry
    row("toilet", Form::Toilet, [(0.38, 0.42), (0.62, 0.70), (0.76, 0.82)], Floor, Front, &["white", "beige"], CERAMIC, "relieving oneself", &["stool", "bathtub"]),
    row("bathtub", Form::Bathtub, [(1.60, 1.75), (0.72, 0.80), (0.56, 0.60)], Floor, Any, &["white", "beige"], &["enamel", "plastic"], "taking a bath", &["sink", "bed"]),
    row("washing machine", Form::Washer, [(0.60, 0.60), (0.58, 0.62), (0.85, 0.87)], Floor, Front, &["white", "grey", "black"], METAL, "washing clothes", &["dryer", "dishwasher"]),
    row("dryer", Form::Washer, [(0.60, 0.60), (0.58, 0.62), (0.85, 0.87)], Floor, Front, &["white", "grey"], METAL, "drying clothes", &["washing machine", "dishwasher"]),
    row("laundry basket", Form::Bin, [(0.38, 0.46), (0.38, 0.46), (0.50, 0.60)], Floor, Any, &["beige", "white", "blue", "pink"], &["wicker", "plastic"], "collecting dirty clothes", &["trash bin", "plant"]),
    // Bedroom
    row("bed", Form::Bed, [(0.95, 1.70), (2.02, 2.10), (0.85, 1.05)], Floor, Any, CLOTHS, &["wood", "fabric"], "sleeping", &["sofa", "bench"]),
    // Office machines
    row("copier", Form::Copier, [(0.60, 0.70), (0.60, 0.68), (1.05, 1.15)], Floor, Front, &["white", "grey"], PLASTIC, "copying documents", &["printer", "washing machine"]),
    row("vending machine", Form::Fridge, [(0.85, 0.95), (0.75, 0.85), (1.80, 1.90)], Floor, Front, &["red", "blue", "black", "green"], METAL, "selling snacks and drinks", &["fridge", "wardrobe"]),
    row("water dispenser", Form::Dispenser, [(0.32, 0.36), (0.32, 0.36), (1.15, 1.25)], Floor, Front, &["white", "blue"], PLASTIC, "drinking cold water", &["fridge", "trash bin"]),
    // Loose things on the floor
    row("plant", Form::Plant, [(0.45, 0.65), (0.45, 0.65), (0.80, 1.60)], Floor, Any, &["green"], &["foliage"], "decoration", &["vase", "coat rack"]),
    row("floor lamp", Form::FloorLamp, [(0.36, 0.44), (0.36, 0.44), (1.45, 1.70)], Floor, Any, BRIGHT, METAL, "lighting a corner", &["coat rack", "lamp"]),
    row("trash bin", Form::Bin, [(0.26, 0.34), (0.26, 0.34), (0.35, 0.60)], Floor, Any, &["black", "grey", "white", "red", "blue", "green"], &["plastic", "metal"], "throwing away waste", &["laundry basket", "stool"]),
    row("suitcase", Form::Suitcase, [(0.42, 0.50), (0.24, 0.30), (0.60, 0.72)], Floor, Any, BRIGHT, &["plastic", "fabric"], "travelling", &["box", "backpack"]),
    row("box", Form::Box, [(0.30, 0.50), (0.28, 0.40), (0.22, 0.40)], Floor, Any, &["brown", "beige", "white", "blue"], &["cardboard", "plastic"], "storing odds and ends", &["suitcase", "stool"]),
    row("vacuum cleaner", Form::Vacuum, [(0.28, 0.32), (0.36, 0.42), (0.95, 1.10)], Floor, Any, &["red", "blue", "black", "yellow"], PLASTIC, "cleaning the floor", &["suitcase", "trash bin"]),
    row("guitar", Form::Guitar, [(0.36, 0.40), (0.26, 0.32), (0.98, 1.05)], Floor, Any, &["brown", "red", "black", "blue"], WOOD, "making music", &["vacuum cleaner", "coat rack"]),
    row("fire extinguisher", Form::Extinguisher, [(0.16, 0.18), (0.16, 0.18), (0.50, 0.56)], Floor, Any, &["red"], METAL, "putting out fires", &["bottle", "trash bin"]),
    row("staircase", Form::Box, [(2.5, 2.6), (3.0, 4.0), (2.8, 2.8)], Floor, Any, &["grey", "beige", "brown"], &["concrete"], "going up and down", &["storage rack"]),
    row("door", Form::Box, [(1.00, 1.40), (0.04, 0.04), (2.00, 2.03)], Floor, Any, &["white", "brown", "beige", "grey", "blue"], WOOD, "closing a room", &["wardrobe", "whiteboard"]),
    // On walls
    row("window", Form::Window, [(1.00, 1.60), (0.03, 0.03), (1.10, 1.30)], Wall(0.90), Any, &["white"], &["glass"], "letting daylight in", &["picture", "mirror"]),
    row("radiator", Form::Radiator, [(0.80, 1.20), (0.09, 0.11), (0.50, 0.60)], Wall(0.12), Any, &["white", "grey"], METAL, "heating", &["bench", "cabinet"]),
    row("picture", Form::Framed, [(0.50, 0.90), (0.03, 0.03), (0.40, 0.70)], Wall(1.15), Any, &["blue", "red", "green", "yellow", "orange", "purple", "pink"], &["canvas", "paper"], "decoration", &["window", "mirror"]),
    row("mirror", Form::Framed, [(0.50, 0.80), (0.03, 0.03), (0.70, 0.90)], Wall(1.05), Any, &["grey"], &["glass"], "looking at oneself", &["picture", "window"]),
    row("whiteboard", Form::Framed, [(1.20, 1.80), (0.03, 0.03), (0.90, 1.10)], Wall(0.90), Any, &["white"], &["enamel"], "sketching ideas", &["picture", "television"]),
    row("clock", Form::Disc, [(0.28, 0.34), (0.05, 0.05), (0.28, 0.34)], Wall(1.40), Any, &["white", "black", "red", "yellow"], PLASTIC, "telling the time", &["picture", "mirror"]),
    row("towel", Form::Towel, [(0.40, 0.55), (0.05, 0.06), (0.60, 0.75)], Wall(0.75), Any, &["white", "blue", "pink", "yellow", "green"], &["cotton"], "drying hands", &["picture", "pillow"]),
    // On furniture
    row("television", Form::Screen, [(0.95, 1.20), (0.20, 0.24), (0.62, 0.75)], Top, Front, &["black"], PLASTIC, "watching films", &["monitor", "picture"]),
    row("monitor", Form::Screen, [(0.50, 0.62), (0.16, 0.20), (0.42, 0.50)], Top, Front, &["black", "grey", "white"], PLASTIC, "showing a computer screen", &["television", "laptop"]),
    row("keyboard", Form::Box, [(0.40, 0.44), (0.14, 0.16), (0.025, 0.03)], Top, Any, TECH, PLASTIC, "typing", &["laptop", "book"]),
    row("laptop", Form::Laptop, [(0.32, 0.36), (0.24, 0.28), (0.20, 0.24)], Top, Any, &["grey", "black", "white"], METAL, "computer work", &["keyboard", "book"]),
    row("phone", Form::Box, [(0.16, 0.20), (0.16, 0.18), (0.07, 0.09)], Top, Any, &["black", "white", "red"], PLASTIC, "making calls", &["clock", "box"]),
    row("printer", Form::Printer, [(0.40, 0.46), (0.34, 0.40), (0.24, 0.32)], Top, Any, &["white", "grey", "black"], PLASTIC, "printing pages", &["microwave", "box"]),
    row("lamp", Form::TableLamp, [(0.22, 0.28), (0.22, 0.28), (0.38, 0.50)], Top, Any, BRIGHT, &["metal", "ceramic"], "reading light", &["vase", "floor lamp"]),
    row("mug", Form::Mug, [(0.12, 0.13), (0.09, 0.10), (0.10, 0.12)], Top, Any, BRIGHT, CERAMIC, "drinking coffee or tea", &["bowl", "vase", "bottle"]),
    row("bottle", Form::Bottle, [(0.08, 0.09), (0.08, 0.09), (0.24, 0.32)], Top, Any, &["green", "blue", "brown", "white", "red"], &["glass", "plastic"], "holding drinks", &["vase", "mug"]),
    row("bowl", Form::Bowl, [(0.18, 0.26), (0.18, 0.26), (0.08, 0.11)], Top, Any, BRIGHT, &["ceramic", "wood", "glass"], "serving food", &["plate", "mug"]),
    row("plate", Form::Bowl, [(0.22, 0.26), (0.22, 0.26), (0.03, 0.04)], Top, Any, &["white", "blue", "green", "yellow"], CERAMIC, "eating from", &["bowl", "book"]),
    row("vase", Form::Vase, [(0.14, 0.18), (0.14, 0.18), (0.24, 0.36)], Top, Any, BRIGHT, &["ceramic", "glass"], "holding flowers", &["bottle", "mug", "lamp"]),
    row("book", Form::Book, [(0.16, 0.20), (0.22, 0.26), (0.04, 0.07)], Top, Any, &["red", "blue", "green", "yellow", "black", "purple", "orange"], &["paper"], "reading", &["box", "laptop"]),
    row("kettle", Form::Kettle, [(0.18, 0.22), (0.16, 0.18), (0.22, 0.26)], Top, Any, &["grey", "white", "black", "red"], &["steel", "plastic"], "boiling water", &["bottle", "coffee machine"]),
    row("toaster", Form::Box, [(0.28, 0.32), (0.17, 0.20), (0.19, 0.22)], Top, Any, &["grey", "black", "red", "white"], METAL, "toasting bread", &["box", "microwave"]),
    row("microwave", Form::Microwave, [(0.46, 0.50), (0.36, 0.40), (0.27, 0.30)], Top, Front, &["white", "black", "grey"], METAL, "heating food", &["printer", "toaster"]),
    row("coffee machine", Form::CoffeeMachine, [(0.26, 0.32), (0.34, 0.40), (0.34, 0.40)], Top, Front, &["black", "grey", "red"], &["plastic", "steel"], "brewing coffee", &["kettle", "microwave"]),
    row("pillow", Form::Pillow, [(0.55, 0.65), (0.36, 0.42), (0.12, 0.15)], Top, Any, &["white", "blue", "grey", "yellow", "pink"], &["cotton"], "resting one's head", &["towel", "backpack"]),
    row("backpack", Form::Backpack, [(0.30, 0.34), (0.22, 0.26), (0.42, 0.48)], Floor, Any, BRIGHT, &["fabric"], "carrying things on one's back", &["suitcase", "pillow"]),
    row("teddy bear", Form::Bear, [(0.24, 0.30), (0.22, 0.26), (0.32, 0.40)], Top, Any, &["brown", "beige", "white", "pink"], &["plush"], "playing and cuddling", &["pillow", "backpack"]),
    row("microscope", Form::Microscope, [(0.18, 0.22), (0.26, 0.30), (0.36, 0.42)], Top, Any, &["white", "black", "blue"], METAL, "looking at tiny things", &["coffee machine", "lamp"]),
    row("paper stack", Form::Box, [(0.22, 0.24), (0.30, 0.32), (0.06, 0.12)], Top, Any, &["white"], &["paper"], "printing and copying", &["book", "box"]),
    row("alarm clock", Form::Box, [(0.12, 0.16), (0.07, 0.08), (0.09, 0.12)], Top, Any, &["black", "white", "red", "green"], PLASTIC, "waking up in time", &["phone", "clock"]),
    row("soap dispenser", Form::Bottle, [(0.07, 0.08), (0.07, 0.08), (0.17, 0.20)], Top, Any, &["white", "blue", "green", "pink"], PLASTIC, "washing hands", &["bottle", "mug"]),
    row("toolbox", Form::Suitcase, [(0.42, 0.50), (0.22, 0.26), (0.24, 0.28)], Top, Any, &["red", "blue", "yellow", "black"], &["metal", "plastic"], "keeping tools together", &["box", "suitcase"]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colors::COLORS;

    #[test]
    fn the_table_is_consistent() {
        assert!(CLASSES.len() >= 40);
        for (i, c) in CLASSES.iter().enumerate() {
            assert!(CLASSES[..i].iter().all(|d| d.name != c.name), "{} twice", c.name);
            assert!(!c.look_alikes.is_empty() && !c.colors.is_empty() && !c.materials.is_empty());
            assert!(
                c.look_alikes.iter().all(|l| *l != c.name && class(l).is_some()),
                "{} looks like nothing known",
                c.name
            );
            assert!(c.colors.iter().all(|n| COLORS.iter().any(|(m, _)| m == n)), "{}", c.name);
            assert!(c.size_m.iter().all(|(low, high)| *low > 0.0 && low <= high), "{}", c.name);
        }
    }

    #[test]
    fn an_office_chair_may_be_called_a_chair() {
        assert!(may_be_called("office chair", "chair"));
        assert!(!may_be_called("armchair", "chair"));
    }
}
