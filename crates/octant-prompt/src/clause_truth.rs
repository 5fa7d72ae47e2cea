//! Is a claim about a thing true, and of that thing alone? Looked up in the boxes by plain inequalities, without the operators of the
//! grounder. Where the boxes were measured ([`Scene::box_error_m`]), only what their error cannot turn round is true.

use dsg::Aabb;
use nalgebra::{Point3, Vector2, Vector3};

use crate::claim::{Claim, Group, Order};
use crate::color_truth::is_called;
use crate::refer_set::middle_of;
use crate::scene::{Scene, Thing};

/// The things among which a description must be true of one alone, and where its viewer stands.
#[derive(Debug, Clone)]
pub struct Surroundings<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Indices of all things in it, or of those of one room.
    pub things: Vec<usize>,
    /// The middle of these things, at eye height.
    pub eye: Point3<f64>,
    /// How far from there the viewer may stand, metres: [`EYE_ERROR_M`] where the boxes were measured, else zero.
    pub eye_error_m: f64,
}

/// How far the middle of a room is from where a robot takes it to be that has not seen all of it, metres.
pub const EYE_ERROR_M: f64 = 0.5;

impl<'a> Surroundings<'a> {
    /// Everything.
    pub fn whole(scene: &'a Scene) -> Surroundings<'a> {
        Surroundings::of(scene, (0..scene.things.len()).collect())
    }

    /// These things of the scene.
    pub fn of(scene: &'a Scene, things: Vec<usize>) -> Surroundings<'a> {
        let eye = middle_of(scene, things.iter().copied());
        let eye_error_m = if scene.box_error_m > 0.0 { EYE_ERROR_M } else { 0.0 };
        Surroundings { scene, things, eye, eye_error_m }
    }

    /// The things with the same label as the one at `index`, without it; and those that may bear it, by their votes.
    pub fn twins(&self, index: usize) -> Vec<usize> {
        let may_be = |other: &usize| *other != index && may_be_called(self.scene, *other, self.scene.label(index));
        self.things.iter().copied().filter(may_be).collect()
    }

    /// Whether nobody can say how many things of the label there are.
    fn has_doubtful_twins(&self, index: usize) -> bool {
        let label = self.scene.label(index);
        self.twins(index).iter().any(|other| self.scene.label(*other) != label)
    }

    /// Where the viewer may stand.
    fn eyes(&self) -> impl Iterator<Item = Point3<f64>> + '_ {
        const AROUND: [(f64, f64); 5] = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let count = if self.eye_error_m > 0.0 { AROUND.len() } else { 1 };
        AROUND[..count].iter().map(|(x, y)| self.eye + self.eye_error_m * Vector3::new(*x, *y, 0.0))
    }

    fn bounds(&self, index: usize) -> &'a Aabb {
        &self.scene.things[index].bounds
    }
}

/// Votes for another label, relative to the winner's, above which a thing may be called by it.
const DOUBTFUL_VOTES: f64 = 0.3;

fn may_be_called(scene: &Scene, index: usize, label: &str) -> bool {
    let classes = &scene.things[index].classes;
    let bears =
        |(class, weight): &(u32, f64)| *weight >= DOUBTFUL_VOTES && scene.classes[*class as usize].text == label;
    classes.iter().any(bears)
}

/// Whether a thing is fit to say where another one is, or to tell a room by: nothing else was voted for nearly as often, and no other thing
/// takes up its place, as doubles do in a map.
pub(crate) fn is_sure(scene: &Scene, index: usize) -> bool {
    /// Common share of two boxes that are one thing twice.
    const DOUBLE: f64 = 0.4;
    let thing = &scene.things[index];
    if thing.classes.iter().skip(1).any(|(_, weight)| *weight >= DOUBTFUL_VOTES) {
        return false;
    }
    let is_double = |other: &Thing| {
        let common: f64 = (0..3)
            .map(|k| {
                let common_m =
                    other.bounds.max[k].min(thing.bounds.max[k]) - other.bounds.min[k].max(thing.bounds.min[k]);
                common_m.max(0.0)
            })
            .product();
        let both = thing.bounds.volume_m3() + other.bounds.volume_m3() - common;
        other.id != thing.id && common > DOUBLE * both
    };
    scene.box_error_m == 0.0 || !scene.things.iter().any(is_double)
}

/// Whether all claims hold of the thing at `index` and of no other with its label: among those of the group, if there is one.
pub fn singles_out(group: Option<&Group>, claims: &[Claim], around: &Surroundings, index: usize) -> bool {
    if !around.things.contains(&index) {
        return false;
    }
    let members = match group {
        None => Some(around.twins(index)),
        Some(group) => others_of_group(group, around, index),
    };
    let Some(members) = members else { return false };
    if (group.is_some() || claims.iter().any(Claim::is_ordinal)) && around.has_doubtful_twins(index) {
        return false; // counted among how many?
    }
    let among =
        |own: usize| -> Vec<usize> { members.iter().copied().chain([index]).filter(|other| *other != own).collect() };
    claims.iter().all(|claim| is_true(claim, around, index, &members))
        && members.iter().all(|twin| claims.iter().any(|claim| is_false(claim, around, *twin, &among(*twin))))
}

/// The other members of a group of things of one label in which the thing at `index` is; None if it is not, or if it is not clear who is.
pub(crate) fn others_of_group(group: &Group, around: &Surroundings, index: usize) -> Option<Vec<usize>> {
    let all: Vec<usize> = around.twins(index).into_iter().chain([index]).collect();
    let others = match group.by {
        Claim::Nth(1, order) => {
            // Every member clearly before every other thing.
            let is_before_all_but = |thing: usize, allowed: usize| {
                let later = all.iter().filter(|other| **other != thing && comes_before(order, around, thing, **other));
                later.count() + 1 + allowed >= all.len()
            };
            let count = group.count as usize;
            let members: Vec<usize> =
                all.iter().copied().filter(|thing| is_before_all_but(*thing, count.saturating_sub(1))).collect();
            let is_apart = |member: &usize| {
                all.iter()
                    .filter(|other| !members.contains(other))
                    .all(|other| comes_before(order, around, *member, *other))
            };
            (members.len() == count && members.iter().all(is_apart)).then_some(members)?
        }
        Claim::Nth(..) => return None,
        ref claim => {
            let members: Vec<usize> =
                all.iter().copied().filter(|thing| !is_false(claim, around, *thing, &[])).collect();
            let is_clear = members.iter().all(|thing| is_true(claim, around, *thing, &[]));
            (is_clear && members.len() == group.count as usize).then_some(members)?
        }
    };
    others.contains(&index).then(|| others.into_iter().filter(|other| *other != index).collect())
}

/// Difference of distances that people see, metres (Sr3D's generator asks for 0.2 m).
const SEEN_M: f64 = 0.2;
/// The same where somebody counts, and looks more closely, metres.
const COUNTED_M: f64 = SEEN_M / 2.0;
/// Difference of heights that people see in a stack, metres.
const STACKED_M: f64 = 0.03;
/// Least offset of what is left or right of a thing, in front of it or behind it, metres.
const BESIDE_M: f64 = 0.3;
/// Ratio of sizes that people see.
const SEEN_RATIO: f64 = 1.15;

/// Whether the claim holds of the thing at `index`, clearly enough that people would not quarrel about it. `rivals` are the things that it is
/// compared with: the others of its class.
pub fn is_true(claim: &Claim, around: &Surroundings, index: usize, rivals: &[usize]) -> bool {
    holds(claim, around, index, rivals, around.scene.box_error_m)
}

/// Whether the claim clearly does not hold: not for another judge of colours, materials and purposes, not if the boxes are off.
fn is_false(claim: &Claim, around: &Surroundings, index: usize, rivals: &[usize]) -> bool {
    let thing = &around.scene.things[index];
    match claim {
        Claim::Color(word) => match (&thing.color_name, &thing.color) {
            (Some(name), _) => !is_one_color(name, word),
            (None, Some(rgb)) => is_called(word, rgb) == Some(false),
            (None, None) => false,
        },
        Claim::Material(word) => thing.material.as_ref().is_some_and(|material| material != word),
        Claim::Function(phrase) => thing.function.as_ref().is_some_and(|function| function != phrase),
        // An order that is clear one way is clear the other way.
        Claim::Nth(..) => !is_true(claim, around, index, rivals),
        _ => !holds(claim, around, index, rivals, -around.scene.box_error_m),
    }
}

/// The claim with every border moved by `margin_m`: up for what must be clear, down for what must be excluded.
fn holds(claim: &Claim, around: &Surroundings, index: usize, rivals: &[usize], margin_m: f64) -> bool {
    let own = around.bounds(index);
    let thing = &around.scene.things[index];
    // What depends on the viewer must hold from wherever he may stand, and may not hold from anywhere if it is to be excluded.
    let seen = |holds: &dyn Fn(&Point3<f64>) -> bool| {
        let mut eyes = around.eyes();
        if margin_m < 0.0 { eyes.any(|eye| holds(&eye)) } else { eyes.all(|eye| holds(&eye)) }
    };
    // No margin loosens what makes a claim true; shares move by as much as lengths, in metres.
    let (share, loose_m) = (margin_m, margin_m.min(0.0));
    match *claim {
        Claim::Color(word) => match &thing.color_name {
            Some(name) => is_one_color(name, word),
            None => thing.color.is_some_and(|rgb| is_called(word, &rgb) == Some(true)),
        },
        Claim::Material(ref word) => thing.material.as_ref() == Some(word),
        Claim::Function(ref phrase) => thing.function.as_ref() == Some(phrase),
        Claim::InGroup(anchor) => {
            let scene = around.scene;
            let is_support = |group: usize| scene.groups[group].support == Some(scene.things[anchor].id);
            index != anchor && thing.group.is_some_and(is_support)
        }
        Claim::On(anchor) => {
            let dz_m = own.min.z - around.bounds(anchor).max.z;
            overlap_share(own, around.bounds(anchor)) > 0.5 + share && dz_m.abs() < 0.1 - loose_m
        }
        Claim::In(anchor) => share_inside(own, around.bounds(anchor)) > 0.7 + share,
        Claim::Under(anchor) => {
            let anchor = around.bounds(anchor);
            overlap_share(own, anchor) > 0.5 + share && anchor.min.z - own.max.z > -0.05 + loose_m
        }
        // What has a front has it whoever looks.
        Claim::InFrontOf(anchor) | Claim::Behind(anchor) if around.scene.things[anchor].front.is_some() => false,
        Claim::LeftOf(anchor) => seen(&|eye| beside_m(around, eye, index, anchor, margin_m).x > BESIDE_M + margin_m),
        Claim::RightOf(anchor) => seen(&|eye| -beside_m(around, eye, index, anchor, margin_m).x > BESIDE_M + margin_m),
        Claim::InFrontOf(anchor) => {
            seen(&|eye| -beside_m(around, eye, index, anchor, margin_m).y > BESIDE_M + margin_m)
        }
        Claim::Behind(anchor) => seen(&|eye| beside_m(around, eye, index, anchor, margin_m).y > BESIDE_M + margin_m),
        Claim::Between(a, b) => is_between(own, around.bounds(a), around.bounds(b), margin_m),
        // The first must stand out; who counts further compares pair by pair.
        Claim::Nth(1, order) if !matches!(order, Order::FromLeft | Order::FromRight) => {
            !rivals.is_empty() && rivals.iter().all(|rival| stands_out(order, around, index, *rival))
        }
        Claim::Nth(n, order) => {
            let before = rivals.iter().filter(|rival| comes_before(order, around, **rival, index)).count();
            let after = rivals.iter().filter(|rival| comes_before(order, around, index, **rival)).count();
            !rivals.is_empty() && before + 1 == n as usize && before + after == rivals.len()
        }
    }
}

fn is_one_color(a: &str, b: &str) -> bool {
    let grey = |word: &str| matches!(word, "gray" | "grey");
    a == b || (grey(a) && grey(b))
}

/// Whether `own` is so far before `rival` that one looks at nothing else.
fn stands_out(order: Order, around: &Surroundings, own: usize, rival: usize) -> bool {
    let (a, b, doubt_m) = (around.bounds(own), around.bounds(rival), around.scene.box_error_m);
    match order {
        Order::ClosestTo(anchor) => is_nearer(SEEN_M + doubt_m, a, b, around.bounds(anchor)),
        Order::FarthestFrom(anchor) => is_nearer(SEEN_M + doubt_m, b, a, around.bounds(anchor)),
        Order::Largest => is_larger(a, b, doubt_m),
        Order::Smallest => is_larger(b, a, doubt_m),
        Order::Highest => height_m(a) > height_m(b) + SEEN_M + doubt_m,
        Order::Lowest => height_m(a) + SEEN_M + doubt_m < height_m(b),
        Order::FromLeft | Order::FromRight => comes_before(order, around, own, rival),
    }
}

/// Whether somebody who counts meets `first` before `second`, and sees that it is so.
fn comes_before(order: Order, around: &Surroundings, first: usize, second: usize) -> bool {
    let (a, b, doubt_m) = (around.bounds(first), around.bounds(second), around.scene.box_error_m);
    match order {
        Order::ClosestTo(anchor) => is_nearer(COUNTED_M + doubt_m, a, b, around.bounds(anchor)),
        Order::FarthestFrom(anchor) => is_nearer(COUNTED_M + doubt_m, b, a, around.bounds(anchor)),
        Order::Largest => is_larger(a, b, doubt_m),
        Order::Smallest => is_larger(b, a, doubt_m),
        Order::Highest => is_higher(a, b, doubt_m),
        Order::Lowest => is_higher(b, a, doubt_m),
        Order::FromLeft | Order::FromRight => {
            // Somebody who sees both at once; 0.02 rad is a hand's breadth across the room.
            let sign = if order == Order::FromLeft { -1.0 } else { 1.0 };
            around.eyes().all(|eye| (0.02..1.2).contains(&(sign * turn_rad(&eye, a, b))))
        }
    }
}

/// Nearer by the gap, or, of things about as near, by the distance of the middles.
fn is_nearer(seen_m: f64, a: &Aabb, b: &Aabb, to: &Aabb) -> bool {
    let gap_m = |a: &Aabb| {
        (0..3).map(|k| (a.min[k] - to.max[k]).max(to.min[k] - a.max[k]).max(0.0).powi(2)).sum::<f64>().sqrt()
    };
    let middles_m =
        |a: &Aabb| (0..3).map(|k| (a.min[k] + a.max[k] - to.min[k] - to.max[k]).powi(2)).sum::<f64>().sqrt() / 2.0;
    gap_m(a) + seen_m < gap_m(b) || (gap_m(a) <= gap_m(b) + 1e-9 && middles_m(a) + seen_m < middles_m(b))
}

/// Larger by volume; where boxes were measured, also by the two longest sides: a thing of which one face was seen has a thin box.
fn is_larger(a: &Aabb, b: &Aabb, doubt_m: f64) -> bool {
    let longest_m = |bounds: &Aabb| {
        let sides: [f64; 3] = std::array::from_fn(|k| bounds.max[k] - bounds.min[k]);
        let thinnest = sides.iter().copied().fold(f64::INFINITY, f64::min);
        (sides.iter().product::<f64>() / thinnest.max(1e-9)).sqrt()
    };
    let is_larger = |a_m: f64, b_m: f64| a_m - doubt_m > SEEN_RATIO * (b_m + doubt_m);
    is_larger(size_m(a), size_m(b)) && (doubt_m == 0.0 || is_larger(longest_m(a), longest_m(b)))
}

/// Seen at once, or closely where one lies over the other.
fn is_higher(a: &Aabb, b: &Aabb, doubt_m: f64) -> bool {
    let rise_m = height_m(a) - height_m(b) - doubt_m;
    rise_m > COUNTED_M || (rise_m > STACKED_M && overlap_share(a, b) > 0.5)
}

fn size_m(bounds: &Aabb) -> f64 {
    (0..3).map(|k| bounds.max[k] - bounds.min[k]).product::<f64>().cbrt()
}

fn height_m(bounds: &Aabb) -> f64 {
    0.5 * (bounds.min.z + bounds.max.z)
}

/// Metres to the left of the anchor and beyond it, for somebody at the eye who looks at it. The smaller of the two is zero if it is less than half
/// of the other, and both are if neither is much larger: then people say neither. So they do beyond 3 m. A margin moves these borders.
fn beside_m(around: &Surroundings, eye: &Point3<f64>, own: usize, anchor: usize, margin_m: f64) -> Vector2<f64> {
    /// Farther away, nobody says "beside".
    const FAR_M: f64 = 3.0;
    let (far_m, ratio) = (FAR_M - margin_m, 2.0 * (1.0 + 2.0 * margin_m));
    let center = |index: usize| around.bounds(index).center().xy().coords;
    let ahead = center(anchor) - eye.xy().coords;
    let Some(ahead) = ahead.try_normalize(0.3) else { return Vector2::zeros() };
    let offset = center(own) - center(anchor);
    let (left_m, beyond_m) = (ahead.x * offset.y - ahead.y * offset.x, ahead.dot(&offset));
    let only =
        |value: f64, other: f64| if value.abs() > ratio * other.abs() && value.abs() < far_m { value } else { 0.0 };
    Vector2::new(only(left_m, beyond_m), only(beyond_m, left_m))
}

/// By how much somebody at `eye` turns left from `own` to `other`, radians.
fn turn_rad(eye: &Point3<f64>, own: &Aabb, other: &Aabb) -> f64 {
    let eye = eye.xy().coords;
    let towards =
        |bounds: &Aabb| Vector2::new(0.5 * (bounds.min.x + bounds.max.x), 0.5 * (bounds.min.y + bounds.max.y)) - eye;
    let (a, b) = (towards(own), towards(other));
    (a.x * b.y - a.y * b.x).atan2(a.dot(&b))
}

fn is_between(own: &Aabb, a: &Aabb, b: &Aabb, margin_m: f64) -> bool {
    let center = |bounds: &Aabb| Vector2::new(0.5 * (bounds.min.x + bounds.max.x), 0.5 * (bounds.min.y + bounds.max.y));
    let (p, q, s) = (center(a), center(b), center(own));
    let axis = q - p;
    let length_m = axis.norm();
    if length_m < 0.5 {
        return false;
    }
    let along = (s - p).dot(&axis) / (length_m * length_m);
    let across_m = ((s - p).x * axis.y - (s - p).y * axis.x).abs() / length_m;
    (0.2 + margin_m / 2.0..0.8 - margin_m / 2.0).contains(&along) && across_m < 0.4 - margin_m
}

/// Share of the box that lies within the other.
fn share_inside(a: &Aabb, b: &Aabb) -> f64 {
    let share = |k: usize| {
        let side_m = (a.max[k] - a.min[k]).max(0.01);
        ((a.max[k].min(b.max[k]) - a.min[k].max(b.min[k])).max(0.0) / side_m).min(1.0)
    };
    (0..3).map(share).product()
}

/// Share of the smaller footprint that lies over the other.
fn overlap_share(a: &Aabb, b: &Aabb) -> f64 {
    let side = |bounds: &Aabb, k: usize| (bounds.max[k] - bounds.min[k]).max(0.01);
    let common = |k: usize| (a.max[k].min(b.max[k]) - a.min[k].max(b.min[k])).max(0.0);
    common(0) * common(1) / (side(a, 0) * side(a, 1)).min(side(b, 0) * side(b, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::describe;
    use crate::refer_set::read_scene;
    use dsg::ObjectId;

    fn scene() -> Scene {
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],
            [3,"window",-0.5,0,1.5,0.1,1,1,20,20,20,null,null,null],[4,"table",2,2,0.4,1,1,0.7,12,9,6,null,null,null],[5,"mug",2,2,0.8,0.1,0.1,0.1,9,9,9,null,null,null]]}"#;
        read_scene(&line.replace('\n', "")).expect("sound").1
    }

    #[test]
    fn claims_by_hand() {
        let scene = scene();
        let around = Surroundings::whole(&scene);
        let holds = |claim: Claim, index: usize| is_true(&claim, &around, index, &around.twins(index));
        let nearest = Claim::Nth(1, Order::ClosestTo(2));
        assert!(holds(nearest.clone(), 0) && !holds(nearest, 1));
        assert!(holds(Claim::Nth(2, Order::ClosestTo(2)), 1));
        assert!(holds(Claim::On(3), 4) && holds(Claim::Under(4), 3));
        assert!(!holds(Claim::Nth(1, Order::Largest), 0), "equal sizes");
        assert!(!holds(Claim::Between(2, 4), 1));
        assert!(holds(Claim::Color("black"), 4) && !holds(Claim::Color("white"), 4));
    }

    #[test]
    fn what_is_true_of_two_singles_out_none() {
        let scene = scene();
        let around = Surroundings::whole(&scene);
        let nearest = [Claim::Nth(1, Order::ClosestTo(2))];
        assert!(singles_out(None, &nearest, &around, 0) && !singles_out(None, &nearest, &around, 1));
        assert!(singles_out(None, &[], &around, 3), "the only table");
        assert!(!singles_out(None, &[], &around, 0), "one of two chairs");
        // Under a roof over both chairs, "under the roof" is true of each and tells them apart from nothing.
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],
            [3,"roof",2,0,3,9,9,0.1,20,20,20,null,null,null]]}"#;
        let scene = read_scene(&line.replace('\n', "")).expect("sound").1;
        let around = Surroundings::whole(&scene);
        assert!(is_true(&Claim::Under(2), &around, 0, &[1]) && !singles_out(None, &[Claim::Under(2)], &around, 0));
        // A doubtful colour on the other one tells nothing apart either: dark red or brown, who knows.
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,200,20,20,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,100,60,50,null,null,null]]}"#;
        let scene = read_scene(line).expect("sound").1;
        let around = Surroundings::whole(&scene);
        assert!(
            is_true(&Claim::Color("red"), &around, 0, &[1]) && !singles_out(None, &[Claim::Color("red")], &around, 0)
        );
    }

    #[test]
    fn groups_are_counted_out_and_their_border_is_clear() {
        // Chairs at x = 0, 1, 2 and 5; a door at x = -1; a cup stands on none of them.
        let chair = |id: u64, x: f64| format!("[{id},\"chair\",{x},0,0.4,0.5,0.5,0.8,9,6,4,null,null,null]");
        let line = format!(
            r#"{{"scene":"s","objects":[{},{},{},{},[9,"door",-1,0,1,0.1,0.9,2,9,9,9,null,null,null]]}}"#,
            chair(1, 0.0),
            chair(2, 1.0),
            chair(3, 2.0),
            chair(4, 5.0)
        );
        let scene = read_scene(&line).expect("sound").1;
        let around = Surroundings::whole(&scene);
        let near = |count: u32| Group { count, by: Claim::Nth(1, Order::ClosestTo(4)) };
        let far = |n: u32| [Claim::Nth(n, Order::FarthestFrom(4))];
        assert!(singles_out(Some(&near(3)), &far(1), &around, 2), "of the 3 nearest the farthest");
        assert!(singles_out(Some(&near(2)), &far(1), &around, 1));
        assert!(!singles_out(Some(&near(3)), &far(1), &around, 3), "it is no member");
        assert!(!singles_out(Some(&near(3)), &far(1), &around, 1), "it is the second farthest of them");
        let on = Group { count: 2, by: Claim::On(4) };
        assert!(!singles_out(Some(&on), &far(1), &around, 0), "nothing stands on the door");
    }

    #[test]
    fn the_shortest_description_is_found_and_true() {
        let scene = scene();
        assert_eq!(describe(&scene, ObjectId(5)).expect("unique class").text, "the mug");
        let chair = describe(&scene, ObjectId(1)).expect("by the window");
        assert_eq!(chair.text, "the chair closest to the window");
        assert!(chair.claims.iter().all(|claim| is_true(claim, &Surroundings::whole(&scene), 0, &[1])));
    }
}
