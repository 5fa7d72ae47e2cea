//! Small things on furniture, near the edge where a passing robot sees them.

use rand::RngExt;
use rand::seq::{IndexedRandom, SliceRandom};

use crate::building::{Bounds, RoomKind};
use crate::catalog::class;
use crate::colors::draw_color;
use crate::cooccurrence::{Cooccurrence, Habits};
use crate::item::Item;
use crate::models::build;
use crate::passage::Reach;
use crate::placement::Furnisher;
use crate::shape::{Placement, Surface};
use crate::viewing::is_viewable;

/// Smallest distance between a thing and the edge of what it stands on, metres.
const EDGE_MIN_M: f64 = 0.02;
/// Largest distance from the edge; screens stand farther back.
pub const EDGE_MAX_M: f64 = 0.13;
/// Smallest gap between two small things, metres.
const BETWEEN_M: f64 = 0.01;
/// Places tried for one thing.
const TRIES: usize = 24;

/// Puts small things on everything that carries some.
pub fn strew(furnisher: &mut Furnisher, kind: RoomKind, habits: &Habits) {
    let Some(reach) = furnisher.reach() else {
        return;
    };
    for support in 0..furnisher.items.len() {
        let own = furnisher.items[support].class.name;
        if habits.cooccurrence != Cooccurrence::Usual && things_on(own, kind).2.1 == 0 {
            continue; // carries nothing
        }
        let name = match habits.cooccurrence {
            Cooccurrence::Uniform => Habits::any_support(furnisher.rng),
            _ => habits.support_of(own),
        };
        let (certain, likely, count) = things_on(name, kind);
        for thing in certain {
            stand(furnisher, thing, support, &reach);
        }
        let count = furnisher.rng.random_range(count.0..=count.1);
        let mut left: Vec<(&str, f64)> = likely.to_vec();
        for _ in 0..count {
            let Ok((thing, _)) = left.choose_weighted(furnisher.rng, |l| l.1).copied() else {
                break;
            };
            // Books come in numbers, most other things once.
            left.iter_mut()
                .filter(|l| l.0 == thing)
                .for_each(|l| l.1 *= if thing == "book" || thing == "box" { 0.7 } else { 0.1 });
            stand(furnisher, thing, support, &reach);
        }
    }
}

/// Finds a place for a thing on a support; its index, or `None` if no free spot near an edge can be seen.
pub fn stand(furnisher: &mut Furnisher, name: &str, support: usize, reach: &Reach) -> Option<usize> {
    let class = class(name)?;
    let base = furnisher.items[support].clone();
    let is_screen = matches!(name, "television" | "monitor");
    let mut surfaces: Vec<Surface> = base.model.surfaces.clone();
    surfaces.shuffle(furnisher.rng);
    let draw = |range: (f64, f64), f: &mut Furnisher| {
        if range.0 < range.1 { f.rng.random_range(range.0..range.1) } else { range.0 }
    };
    let (w, d, h) =
        (draw(class.size_m[0], furnisher), draw(class.size_m[1], furnisher), draw(class.size_m[2], furnisher));
    let color = *class.colors.choose(furnisher.rng)?;
    let material = *class.materials.choose(furnisher.rng)?;
    let rgb = draw_color(furnisher.rng, color);
    let model = build(class.form, w, d, h, rgb);
    for _ in 0..TRIES {
        let surface = *surfaces.choose(furnisher.rng)?;
        let (dx, dy) = (surface.max.x - surface.min.x, surface.max.y - surface.min.y);
        if h > surface.headroom_m || d + EDGE_MIN_M > dx || w + EDGE_MIN_M > dy {
            continue;
        }
        // Position in the support's frame: a distance from one of its edges, anywhere along it.
        let side = if is_screen { 0 } else { furnisher.rng.random_range(0..6).min(3) };
        let inset = furnisher.rng.random_range(EDGE_MIN_M..EDGE_MAX_M);
        let span = |low: f64, high: f64, f: &mut Furnisher| {
            if low < high { f.rng.random_range(low..high) } else { (low + high) / 2.0 }
        };
        let (hx, hy) = (d / 2.0, w / 2.0);
        let (x_low, x_high) = (surface.min.x + hx, surface.max.x - hx);
        let (y_low, y_high) = (surface.min.y + hy, surface.max.y - hy);
        let (x, y) = match side {
            0 if is_screen => (
                surface.max.x - hx - (dx * 0.5 - hx).max(EDGE_MIN_M),
                span(y_low.max(-0.2), y_high.min(0.2), furnisher),
            ),
            1 => (span(x_low, x_high, furnisher), y_low + inset),
            2 => (span(x_low, x_high, furnisher), y_high - inset),
            // Most things stand at the front, whatever the number of sides.
            _ => (x_high - inset, span(y_low, y_high, furnisher)),
        };
        if x < x_low || x > x_high || y < y_low || y > y_high {
            continue;
        }
        let turn = match name {
            "television" | "monitor" | "microwave" | "coffee machine" | "printer" => 0.0,
            _ if dx < d + 0.12 || dy < w + 0.12 => 0.0,
            "laptop" | "keyboard" | "phone" | "alarm clock" => furnisher.rng.random_range(-0.15..0.15),
            _ => furnisher.rng.random_range(-0.5..0.5),
        };
        let origin = base.placement.world_from_model(&nalgebra::Point3::new(x, y, surface.min.z));
        let placement = Placement { origin, yaw_rad: base.placement.yaw_rad + turn };
        let bounds = model.bounds(&placement);
        let parts = model.part_bounds(&placement);
        if !stays_on(&base, &surface, &bounds)
            || furnisher.items.iter().enumerate().any(|(k, i)| overlaps(i, k == support, &bounds))
        {
            continue;
        }
        let others: Vec<&[Bounds]> = furnisher.items.iter().map(|i| i.parts.as_slice()).collect();
        if !is_viewable(&bounds, &parts, &others, furnisher.space, reach) {
            continue;
        }
        furnisher.items.push(Item {
            class,
            color,
            rgb,
            material,
            model,
            placement,
            bounds,
            parts,
            support: Some(support),
            with: None,
            is_mover: false,
        });
        return Some(furnisher.items.len() - 1);
    }
    None
}

/// True if the whole foot of the thing stands on the surface.
fn stays_on(base: &Item, surface: &Surface, bounds: &Bounds) -> bool {
    let (a, b) = (base.placement.world_from_model(&surface.min), base.placement.world_from_model(&surface.max));
    let (min, max) = (a.inf(&b), a.sup(&b));
    bounds.min.x >= min.x - 1e-9
        && bounds.max.x <= max.x + 1e-9
        && bounds.min.y >= min.y - 1e-9
        && bounds.max.y <= max.y + 1e-9
}

/// True if the thing would run into another one. A support may surround it (a shelf), so there the parts count.
fn overlaps(item: &Item, is_support: bool, bounds: &Bounds) -> bool {
    if is_support {
        return item.parts.iter().any(|p| p.overlaps(bounds, 1e-9));
    }
    let apart = if item.support.is_some() { BETWEEN_M } else { 0.0 };
    item.bounds.overlaps(bounds, 1e-9 - apart)
}

type Likely = &'static [(&'static str, f64)];

/// What stands on a piece of furniture in a kind of room: certain things, likely things with weights, how many of the latter.
#[rustfmt::skip]
fn things_on(support: &str, kind: RoomKind) -> (&'static [&'static str], Likely, (u32, u32)) {
    use RoomKind as K;
    match (support, kind) {
        ("counter", _) => (&[], &[("mug", 5.0), ("kettle", 3.0), ("toaster", 2.5), ("bowl", 3.0), ("bottle", 3.0), ("plate", 2.5), ("microwave", 2.5), ("coffee machine", 2.0), ("vase", 0.5)], (1, 3)),
        ("dining table", K::Lounge) => (&[], &[("mug", 3.0), ("bottle", 2.0), ("book", 1.0), ("laptop", 1.0)], (1, 3)),
        ("dining table" | "kitchen table", _) => (&[], &[("bowl", 3.0), ("plate", 3.0), ("mug", 2.5), ("vase", 2.5), ("bottle", 2.0), ("book", 0.7)], (2, 4)),
        ("coffee table", _) => (&[], &[("book", 3.0), ("mug", 2.0), ("bowl", 1.5), ("vase", 1.5), ("laptop", 0.7), ("bottle", 0.7)], (1, 3)),
        ("side table", K::PrintRoom) => (&[], &[("paper stack", 3.0), ("printer", 1.0)], (1, 1)),
        ("side table", _) => (&[], &[("lamp", 3.0), ("book", 2.0), ("mug", 1.5), ("vase", 1.0)], (1, 2)),
        ("nightstand", _) => (&[], &[("lamp", 4.0), ("alarm clock", 3.0), ("book", 2.0), ("mug", 1.0), ("phone", 0.7)], (1, 2)),
        ("desk", K::Bedroom) => (&[], &[("laptop", 3.0), ("lamp", 3.0), ("book", 3.0), ("mug", 1.5)], (1, 3)),
        ("desk", _) => (&["monitor", "keyboard"], &[("mug", 3.0), ("book", 2.5), ("laptop", 2.0), ("phone", 2.5), ("lamp", 2.0), ("printer", 1.0), ("paper stack", 1.5), ("bottle", 1.0)], (1, 3)),
        ("conference table", _) => (&[], &[("laptop", 4.0), ("mug", 2.0), ("bottle", 2.5), ("paper stack", 2.0), ("phone", 1.5)], (2, 4)),
        ("workbench", _) => (&[], &[("microscope", 5.0), ("laptop", 1.5), ("bottle", 2.0), ("box", 1.5), ("toolbox", 2.0), ("monitor", 1.0), ("book", 1.0), ("mug", 0.5)], (1, 3)),
        ("console table", _) => (&[], &[("vase", 3.0), ("lamp", 3.0), ("bowl", 2.0), ("phone", 2.0), ("book", 1.0)], (1, 2)),
        ("reception desk", _) => (&["phone"], &[("monitor", 2.0), ("vase", 2.0), ("paper stack", 1.5), ("mug", 1.0), ("laptop", 1.0)], (1, 3)),
        ("bookshelf", _) => (&[], &[("book", 8.0), ("vase", 1.5), ("box", 1.5), ("teddy bear", 0.7), ("bowl", 0.7)], (3, 6)),
        ("storage rack", K::Lab) => (&[], &[("box", 4.0), ("bottle", 3.0), ("toolbox", 2.0)], (2, 4)),
        ("storage rack", K::PrintRoom) => (&[], &[("paper stack", 6.0), ("box", 3.0)], (2, 4)),
        ("storage rack", _) => (&[], &[("box", 6.0), ("toolbox", 3.0), ("bottle", 2.0), ("soap dispenser", 0.5)], (2, 4)),
        ("dresser", _) => (&[], &[("vase", 2.0), ("lamp", 2.0), ("teddy bear", 1.5), ("book", 1.0), ("alarm clock", 0.7)], (0, 2)),
        ("sideboard", K::MeetingRoom) => (&[], &[("bottle", 2.0), ("mug", 2.0), ("coffee machine", 2.0), ("paper stack", 1.0)], (1, 3)),
        ("sideboard", _) => (&[], &[("vase", 3.0), ("lamp", 2.0), ("bowl", 2.0), ("bottle", 1.5), ("plate", 1.0)], (1, 3)),
        ("tv stand", _) => (&["television"], &[("book", 1.0), ("vase", 0.5)], (0, 1)),
        ("filing cabinet", _) => (&[], &[("printer", 2.0), ("box", 1.0), ("book", 1.0), ("paper stack", 1.0)], (0, 1)),
        ("shoe cabinet", _) => (&[], &[("bowl", 2.0), ("vase", 2.0), ("phone", 0.5)], (0, 1)),
        ("washing machine" | "dryer", _) => (&[], &[("soap dispenser", 2.0), ("box", 1.5), ("bottle", 1.5)], (0, 1)),
        ("cabinet", K::Bathroom | K::Restroom) => (&[], &[("soap dispenser", 2.0), ("bottle", 1.0)], (1, 1)),
        ("sofa", _) => (&[], &[("pillow", 3.0), ("teddy bear", 0.5), ("book", 0.5)], (0, 2)),
        ("bed", _) => (&["pillow"], &[("pillow", 4.0), ("teddy bear", 1.5), ("book", 0.5)], (0, 1)),
        _ => (&[], &[], (0, 0)),
    }
}
