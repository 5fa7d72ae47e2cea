//! What lies beside the bag of a recording: masks as a segmenter gave them, the truth, and tasks in words with their answers.
//!
//! Whoever plays the robot may read the bag, `masks/` and `tasks/tasks.jsonl`; `truth/` and `tasks/answers.jsonl` are for the judge.

use anyhow::Result;
use mission::omni_perception::{Mask, MaskedPanorama, Rle, Stamp};
use nalgebra::Point2;
use omni_sim::building::{Building, DoorAxis};
use omni_sim::region::regions_of;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::referee::Referee;
use crate::run_folder::RunFolder;
use crate::task::{StepTruth, Task, TaskKind, draw};

/// Tasks of each kind at most.
const TASKS_OF_A_KIND: usize = 4;
/// Drawn sentences that are tried for them.
const SENTENCES: usize = 12;

/// `masks/STAMP.json`: what the segmenter saw, in the form that the Grounded-SAM-2 demos write, with captions added.
pub fn masks_json(panorama: &MaskedPanorama, date: Stamp, size: (u32, u32)) -> Value {
    let annotations: Vec<Value> = panorama.masks.iter().map(annotation).collect();
    json!({
        "image_path": format!("/panorama/compressed@{}", date.0),
        "stamp_ns": date.0,
        "annotations": annotations,
        "box_format": "xyxy",
        "img_width": size.0,
        "img_height": size.1,
    })
}

fn annotation(mask: &Mask) -> Value {
    let mut annotation = json!({
        "class_name": mask.label,
        "caption": mask.caption,
        "bbox": box_of(&mask.rle),
        "segmentation": segmentation(&mask.rle),
        "score": mask.score,
    });
    // A tracker's number: it is switched and swapped now and then, and no truth.
    if let Some(track) = mask.track {
        annotation["object_id"] = track.into();
    }
    annotation
}

/// `truth/masks/STAMP.json`: the pixels of each thing, with its number in `truth/objects.json`.
pub fn true_masks_json(instances: &[u32], building: &Building, date: Stamp, size: (u32, u32)) -> Result<Value> {
    let mut annotations = Vec::new();
    for (id, region) in regions_of(instances, size.1) {
        let rle = Rle::from_counts(size.0, size.1, &region.coco_counts(size.0, size.1))?;
        annotations.push(json!({
            "id": id,
            "class_name": building.object(id).map(|object| object.class.as_str()),
            "area": region.area(),
            "bbox": box_of(&rle),
            "segmentation": segmentation(&rle),
        }));
    }
    Ok(json!({
        "stamp_ns": date.0,
        "annotations": annotations,
        "box_format": "xyxy",
        "img_width": size.0,
        "img_height": size.1,
    }))
}

fn segmentation(rle: &Rle) -> Value {
    json!({"size": [rle.height(), rle.width()], "counts": rle.to_coco_string()})
}

/// Left, top, right, bottom; the last two are one past the last pixel. A thing across the seam is as wide as the picture.
fn box_of(rle: &Rle) -> [u32; 4] {
    let mut bounds = [u32::MAX, u32::MAX, 0, 0];
    for span in rle.spans() {
        bounds[0] = bounds[0].min(span.column);
        bounds[1] = bounds[1].min(span.top);
        bounds[2] = bounds[2].max(span.column + 1);
        bounds[3] = bounds[3].max(span.bottom);
    }
    if bounds[0] == u32::MAX { [0; 4] } else { bounds }
}

/// `truth/objects.json`, `truth/rooms.json`, `truth/doors.json`.
pub fn write_building(folder: &RunFolder, building: &Building) -> Result<()> {
    folder.write("truth/objects.json", &serde_json::to_vec_pretty(&objects_json(building))?)?;
    folder.write("truth/rooms.json", &serde_json::to_vec_pretty(&rooms_json(building))?)?;
    let doors: Vec<Value> = building
        .doors
        .iter()
        .map(|door| {
            let center: [f64; 3] = door.center.coords.into();
            let axis = match door.axis {
                DoorAxis::X => "x",
                DoorAxis::Y => "y",
                DoorAxis::Z => "z",
            };
            json!({"rooms": [door.rooms.0, door.rooms.1], "center_m": center, "width_m": door.width_m, "height_m": door.height_m, "axis": axis})
        })
        .collect();
    folder.write("truth/doors.json", &serde_json::to_vec_pretty(&doors)?)
}

/// Every thing with its box.
pub fn objects_json(building: &Building) -> Vec<Value> {
    let object = |object: &omni_sim::building::ObjectTruth| {
        let (min_m, max_m): ([f64; 3], [f64; 3]) = (object.bounds.min.coords.into(), object.bounds.max.coords.into());
        json!({
            "id": object.id, "class": object.class, "color": object.color, "material": object.material,
            "function": object.function, "caption": object.caption, "room": object.room,
            "supported_by": object.supported_by, "min_m": min_m, "max_m": max_m,
        })
    };
    building.objects.iter().map(object).collect()
}

/// Every room with its rectangles.
pub fn rooms_json(building: &Building) -> Vec<Value> {
    let room = |room: &omni_sim::building::RoomTruth| {
        let rects: Vec<_> = room.rects.iter().map(|r| json!([r.min.x, r.min.y, r.max.x, r.max.y])).collect();
        json!({
            "id": room.id, "name": room.name, "kind": room.kind.name(), "rects_m": rects,
            "floor_z_m": room.floor_z_m, "height_m": room.height_m, "storey": room.storey,
        })
    };
    building.rooms.iter().map(room).collect()
}

/// Draws tasks of every kind that this robot can do from where the recording begins.
pub fn draw_tasks(referee: &Referee, building: &Building, start: &Point2<f64>, seed: u64) -> Vec<Task> {
    const KINDS: [TaskKind; 5] =
        [TaskKind::Class, TaskKind::Relation, TaskKind::Room, TaskKind::Attribute, TaskKind::TwoSteps];
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7461_736b);
    let mut tasks = Vec::new();
    for kind in KINDS {
        let sentences = draw(kind, building, &mut rng);
        let possible =
            sentences.into_iter().take(SENTENCES).filter(|task| referee.shortest_m(&task.steps, start).is_some());
        tasks.extend(possible.take(TASKS_OF_A_KIND));
    }
    tasks
}

/// `tasks/tasks.jsonl` (what is asked) and `tasks/answers.jsonl` (what is right), a line each, numbered alike.
pub fn write_tasks(folder: &RunFolder, tasks: &[Task], building: &Building) -> Result<()> {
    let (mut questions, mut answers) = (String::new(), String::new());
    for (number, task) in tasks.iter().enumerate() {
        questions.push_str(&format!("{}\n", json!({"id": number, "kind": task.kind, "instruction": task.text})));
        let steps: Vec<Value> = task.steps.iter().map(|step| answer(step, building)).collect();
        answers.push_str(&format!("{}\n", json!({"id": number, "steps": steps})));
    }
    folder.write("tasks/tasks.jsonl", questions.as_bytes())?;
    folder.write("tasks/answers.jsonl", answers.as_bytes())
}

/// Any of the listed things, or any of the listed rooms, is right.
fn answer(step: &StepTruth, building: &Building) -> Value {
    match step {
        StepTruth::Object { ids } => {
            let centers: Vec<[f64; 3]> =
                ids.iter().filter_map(|id| building.object(*id)).map(|o| o.bounds.center().coords.into()).collect();
            json!({"reach": "object", "ids": ids, "centers_m": centers})
        }
        StepTruth::Start => json!({"reach": "start"}),
        StepTruth::Room { ids } => {
            let names: Vec<&str> = ids.iter().map(|id| building.rooms[*id as usize].name.as_str()).collect();
            json!({"reach": "room", "ids": ids, "names": names})
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_written_as_coco_has_it() {
        // Columns 1 and 2, row 1 of a picture of 4 x 3: one zero column, then 0 1 0, 0 1 0, then zeros.
        let rows: Vec<bool> = (0..12).map(|i| i / 4 == 1 && (1..3).contains(&(i % 4))).collect();
        let rle = Rle::from_rows(4, 3, &rows).unwrap();
        let mask = Mask { rle, label: "mug".into(), score: 0.5, caption: "A mug.".into(), track: None };
        let panorama = MaskedPanorama { stamp: Stamp(0), masks: vec![mask], image: None };
        let json = masks_json(&panorama, Stamp(7), (4, 3));
        assert_eq!(json["annotations"][0]["bbox"], json!([1, 1, 3, 2]));
        assert_eq!(json["annotations"][0]["segmentation"]["size"], json!([3, 4]));
        let text = json["annotations"][0]["segmentation"]["counts"].as_str().unwrap();
        assert_eq!(Rle::from_coco_string(4, 3, text).unwrap(), panorama.masks[0].rle);
        assert_eq!(box_of(&Rle::from_counts(4, 3, &[12]).unwrap()), [0; 4]);
    }
}
