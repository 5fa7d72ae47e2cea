//! What kind of room its contents suggest.
//!
//! Each class of thing speaks for some kinds with a weight (about a log-likelihood ratio: 3 decides alone, 1 needs company).
//! The kind is the largest of softmax(sum of weights) against a constant for "cannot tell". Thresholdless things such as
//! chairs and lamps, which stand anywhere, have no row.

use std::collections::BTreeMap;

use crate::labels::label_similarity;
use crate::object::Object;

/// The kinds a room can be derived to be.
#[rustfmt::skip]
pub const ROOM_KINDS: &[&str] = &[
    "kitchen", "living room", "bedroom", "bathroom", "study", "office", "meeting room", "hallway", "corridor",
    "dining room", "laundry room", "storage room", "lab", "lounge", "print room", "reception", "stairwell",
];

/// Score of "cannot tell".
const CANNOT_TELL: f64 = 1.2;
/// The second thing of a class counts half, the third a quarter, and so on.
const REPEAT: f64 = 0.5;

/// Class of thing -> kinds it speaks for.
const EVIDENCE: &[(&str, &[(&str, f64)])] = &[
    ("fridge", &[("kitchen", 3.0)]),
    ("stove", &[("kitchen", 3.5)]),
    ("oven", &[("kitchen", 3.0)]),
    ("dishwasher", &[("kitchen", 3.0)]),
    ("microwave", &[("kitchen", 2.0)]),
    ("kettle", &[("kitchen", 1.8)]),
    ("toaster", &[("kitchen", 2.0)]),
    ("kitchen counter", &[("kitchen", 3.0)]),
    ("counter", &[("kitchen", 1.5)]),
    ("coffee machine", &[("kitchen", 1.2), ("lounge", 0.6)]),
    ("pot", &[("kitchen", 1.0)]),
    ("pan", &[("kitchen", 1.5)]),
    ("sink", &[("kitchen", 1.0), ("bathroom", 1.0)]),
    ("toilet", &[("bathroom", 4.0)]),
    ("bathtub", &[("bathroom", 4.0)]),
    ("shower", &[("bathroom", 4.0)]),
    ("towel", &[("bathroom", 1.5)]),
    ("toilet paper", &[("bathroom", 2.0)]),
    ("bathroom cabinet", &[("bathroom", 2.5)]),
    ("bed", &[("bedroom", 3.5)]),
    ("nightstand", &[("bedroom", 2.0)]),
    ("wardrobe", &[("bedroom", 1.5)]),
    ("dresser", &[("bedroom", 1.5)]),
    ("pillow", &[("bedroom", 1.0), ("living room", 0.4)]),
    ("sofa", &[("living room", 2.2), ("lounge", 1.2)]),
    ("armchair", &[("living room", 1.0), ("lounge", 1.0)]),
    ("coffee table", &[("living room", 1.5), ("lounge", 0.9)]),
    ("tv", &[("living room", 1.5), ("meeting room", 0.4)]),
    ("tv stand", &[("living room", 2.0)]),
    ("fireplace", &[("living room", 2.5)]),
    ("piano", &[("living room", 1.5)]),
    ("bookshelf", &[("study", 1.0), ("living room", 0.4), ("office", 0.3)]),
    ("dining table", &[("dining room", 2.5), ("kitchen", 0.4)]),
    ("dining chair", &[("dining room", 1.2)]),
    ("sideboard", &[("dining room", 1.2)]),
    ("chandelier", &[("dining room", 1.2)]),
    ("desk", &[("office", 1.4), ("study", 1.4)]),
    ("office chair", &[("office", 1.0), ("study", 0.8), ("meeting room", 0.3)]),
    ("monitor", &[("office", 1.0), ("study", 0.8), ("lab", 0.4)]),
    ("computer", &[("office", 0.8), ("study", 0.7), ("lab", 0.5)]),
    ("keyboard", &[("office", 0.7), ("study", 0.6)]),
    ("laptop", &[("study", 0.5), ("office", 0.5)]),
    ("globe", &[("study", 1.5)]),
    ("filing cabinet", &[("office", 1.5), ("print room", 0.4)]),
    ("conference table", &[("meeting room", 4.0)]),
    ("meeting table", &[("meeting room", 4.0)]),
    ("whiteboard", &[("meeting room", 2.0), ("office", 0.5), ("lab", 0.4)]),
    ("projector", &[("meeting room", 2.5)]),
    ("projector screen", &[("meeting room", 2.5)]),
    ("washing machine", &[("laundry room", 3.0), ("bathroom", 0.6)]),
    ("dryer", &[("laundry room", 3.0)]),
    ("laundry basket", &[("laundry room", 1.8), ("bathroom", 0.6)]),
    ("ironing board", &[("laundry room", 2.2)]),
    ("drying rack", &[("laundry room", 2.0)]),
    ("detergent", &[("laundry room", 1.8)]),
    ("workbench", &[("lab", 2.0), ("storage room", 0.8)]),
    ("lab bench", &[("lab", 4.0)]),
    ("microscope", &[("lab", 3.5)]),
    ("oscilloscope", &[("lab", 3.5)]),
    ("robot arm", &[("lab", 3.0)]),
    ("fume hood", &[("lab", 4.0)]),
    ("centrifuge", &[("lab", 3.5)]),
    ("server rack", &[("lab", 1.8)]),
    ("3d printer", &[("lab", 2.2)]),
    ("toolbox", &[("storage room", 1.0), ("lab", 0.8)]),
    ("printer", &[("print room", 2.0), ("office", 0.7)]),
    ("copier", &[("print room", 3.5)]),
    ("scanner", &[("print room", 1.5)]),
    ("paper shredder", &[("print room", 2.5)]),
    ("reception desk", &[("reception", 4.0)]),
    ("visitor chair", &[("reception", 1.0)]),
    ("vending machine", &[("lounge", 2.0)]),
    ("pool table", &[("lounge", 2.5)]),
    ("beanbag", &[("lounge", 1.5)]),
    ("storage shelf", &[("storage room", 2.0)]),
    ("shelf", &[("storage room", 0.6)]),
    ("box", &[("storage room", 0.9)]),
    ("cardboard box", &[("storage room", 1.2)]),
    ("crate", &[("storage room", 1.2)]),
    ("ladder", &[("storage room", 2.0)]),
    ("vacuum cleaner", &[("storage room", 1.5)]),
    ("broom", &[("storage room", 1.5)]),
    ("mop", &[("storage room", 1.2)]),
    ("suitcase", &[("storage room", 0.7), ("bedroom", 0.6)]),
    ("bicycle", &[("storage room", 1.0)]),
    ("shoe rack", &[("hallway", 2.5)]),
    ("coat rack", &[("hallway", 2.0), ("reception", 0.5)]),
    ("umbrella stand", &[("hallway", 2.5)]),
    ("doormat", &[("hallway", 2.0)]),
    ("fire extinguisher", &[("corridor", 1.8)]),
    ("stairs", &[("stairwell", 4.0)]),
];

/// Shape of a room, as far as it speaks for a kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoomShape {
    /// Length over width of its places; 1 = square or unknown.
    pub elongation: f64,
    /// Ways out.
    pub doors: usize,
}

/// A kind and how sure we are.
#[derive(Debug, Clone, PartialEq)]
pub struct KindGuess {
    /// One of [`ROOM_KINDS`].
    pub kind: &'static str,
    /// Its probability against all others and "cannot tell".
    pub confidence: f64,
}

/// The most likely kind of a room with these things in it. `None` if nothing in it speaks for any.
pub fn room_kind<'a>(contents: impl IntoIterator<Item = &'a Object>, shape: RoomShape) -> Option<KindGuess> {
    room_kind_with(&mut Rows::default(), contents, shape)
}

/// The rows of labels that were looked up: the same few labels are in all rooms of a building.
pub(crate) type Rows<'a> = BTreeMap<&'a str, Option<(usize, f64)>>;

/// [`room_kind`] for one room after another.
pub(crate) fn room_kind_with<'a>(
    rows: &mut Rows<'a>,
    contents: impl IntoIterator<Item = &'a Object>,
    shape: RoomShape,
) -> Option<KindGuess> {
    let mut scores = vec![0.0_f64; ROOM_KINDS.len()];
    let mut seen = vec![0_i32; EVIDENCE.len()];
    for object in contents {
        let row = *rows.entry(&object.label).or_insert_with(|| row_of(&object.label));
        let Some((row, likeness)) = row else { continue };
        // What is doubted speaks softly.
        let belief = likeness * object.vote_share(&object.label) * if object.confirmed { 1.0 } else { 0.2 };
        let weight = belief * REPEAT.powi(seen[row]);
        seen[row] += 1;
        for (kind, strength) in EVIDENCE[row].1 {
            if let Some(at) = ROOM_KINDS.iter().position(|known| known == kind) {
                scores[at] += weight * strength;
            }
        }
    }
    // A long room with several doors is a way between rooms.
    if shape.elongation >= 2.5 && shape.doors >= 2 {
        let bonus = 0.5 * (shape.elongation - 1.5).min(3.0) + 0.4 * (shape.doors.min(5) as f64);
        // A place in a flat has a hallway, one in an office a corridor; without other evidence it is a hallway.
        scores[7] += bonus;
        scores[8] += bonus * 0.5;
    }
    let best = (0..scores.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a)))?;
    if scores[best] <= 0.0 {
        return None;
    }
    let total: f64 =
        scores.iter().map(|score| score.exp()).sum::<f64>() + CANNOT_TELL.exp() - scores.len() as f64 + 1.0;
    Some(KindGuess { kind: ROOM_KINDS[best], confidence: scores[best].exp() / total })
}

/// The row of a label, or of its nearest synonym or head noun, with the likeness.
fn row_of(label: &str) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (row, (class, _)) in EVIDENCE.iter().enumerate() {
        let likeness = label_similarity(label, class);
        if likeness == 1.0 {
            return Some((row, 1.0));
        }
        // A "kitchen counter" is a counter, but a plain "table" is no dining table.
        let is_narrower = likeness >= 0.9 || (likeness >= 0.8 && !class.contains(' '));
        if is_narrower && best.is_none_or(|(_, known)| likeness > known) {
            best = Some((row, likeness));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::bounds::Aabb;
    use crate::ids::ObjectId;

    fn guess(labels: &[&str]) -> Option<KindGuess> {
        let things: Vec<Object> =
            labels.iter().map(|label| Object::new(ObjectId(1), label, Aabb::at(Point3::origin()))).collect();
        room_kind(&things, RoomShape { elongation: 1.0, doors: 1 })
    }

    #[test]
    fn contents_tell_the_kind() {
        let check = |labels: &[&str], expected| {
            let guess = guess(labels).unwrap();
            assert_eq!(guess.kind, expected, "{labels:?}");
            assert!(guess.confidence > 0.6, "{labels:?}: {}", guess.confidence);
        };
        check(&["stove", "refrigerator", "sink"], "kitchen");
        check(&["bed", "nightstand", "lamp"], "bedroom");
        check(&["toilet", "sink"], "bathroom");
        check(&["couch", "television", "coffee table"], "living room");
        check(&["meeting table", "office chair", "whiteboard"], "meeting room");
        check(&["printer", "copier"], "print room");
    }

    #[test]
    fn things_that_stand_anywhere_tell_nothing() {
        assert_eq!(guess(&["chair", "lamp", "plant"]), None);
        assert!(guess(&["sink"]).unwrap().confidence < 0.6);
    }

    #[test]
    fn a_long_room_with_doors_is_a_hallway() {
        let empty: [&Object; 0] = [];
        let guess = room_kind(empty, RoomShape { elongation: 4.0, doors: 4 }).unwrap();
        assert_eq!(guess.kind, "hallway");
        assert!(guess.confidence > 0.6);
    }

    #[test]
    fn every_kind_in_the_table_is_known() {
        for (_, kinds) in EVIDENCE {
            assert!(kinds.iter().all(|(kind, _)| ROOM_KINDS.contains(kind)));
        }
    }
}
