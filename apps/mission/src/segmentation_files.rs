//! Segmentations as the usual tools write them, read and written.
//!
//! ```text
//! Grounded SAM 2   {"image_path", "img_width", "img_height", "box_format": "xyxy",
//!                   "annotations": [{"class_name", "bbox": [x1, y1, x2, y2], "segmentation", "score": f or [f]}]}
//! SAM automatic    {"image": {"image_id", "width", "height", "file_name"},
//!                   "annotations": [{"id", "segmentation", "area", "bbox": [x, y, w, h], "predicted_iou", "stability_score"}]}
//! COCO             {"images": [{"id", "width", "height", "file_name"}], "categories": [{"id", "name"}],
//!                   "annotations": [{"id", "image_id", "category_id", "segmentation", "area", "bbox": [x, y, w, h], "score"}]}
//! segmentation     {"size": [H, W], "counts": "COCO string"} | {"size": [H, W], "counts": [n, ...]} | [[x1, y1, x2, y2, ...], ...]
//! ```
//! Every annotation may also have `caption` (a sentence) and `object_id` (its number in the video; `track_id` and
//! `instance_id` are read as well, as a number or as digits). Masks count, boxes are only written. SAM's automatic masks
//! have no name and become "unknown"; annotations without a score count fully. Unknown keys are ignored.
//!
//! What is read may come from anybody: sizes and numbers are bounded, and every refusal names the place.

use omni_perception::{Mask, Rle, RleError, UNKNOWN};
use serde_json::{Map, Value, json};
use thiserror::Error;

/// Longest text that is read.
pub const MAX_BYTES: usize = 32 << 20;
/// Most annotations that are read of one image.
pub const MAX_ANNOTATIONS: usize = 4096;
/// Longest label or caption in characters; what is longer is cut.
const MAX_TEXT: usize = 1000;

/// The masks of one image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImageSegmentation {
    /// Name or path of the picture, as written.
    pub image: String,
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Its masks.
    pub masks: Vec<Mask>,
}

/// The formats that are read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentationFormat {
    /// What the demonstrations of Grounded SAM 2 write.
    GroundedSam2,
    /// SAM's automatic masks.
    SamAutomatic,
    /// A COCO data set.
    Coco,
}

/// Why a segmentation was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SegmentationError {
    /// Longer than [`MAX_BYTES`].
    #[error("the text has {bytes} bytes; at most {MAX_BYTES} are read")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// Not JSON.
    #[error("it is not JSON: line {line}, column {column}")]
    Json {
        /// Of the first fault.
        line: usize,
        /// Of the first fault.
        column: usize,
    },
    /// None of the formats.
    #[error(
        "it has {found}; a Grounded SAM 2 file has \"annotations\", \"img_width\" and \"img_height\", a file of SAM's automatic masks \
         \"image\" and \"annotations\", a COCO file \"images\", \"categories\" and \"annotations\""
    )]
    Format {
        /// The keys it has, or what it is instead of an object.
        found: String,
    },
    /// A value is missing or of another kind.
    #[error("{place} should be {expected}")]
    Value {
        /// Where, as a path.
        place: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Too many annotations.
    #[error("{found} annotations; at most {MAX_ANNOTATIONS} are read of one image")]
    TooMany {
        /// Their number.
        found: usize,
    },
    /// A mask cannot be read.
    #[error("{place}: {cause}")]
    Mask {
        /// Where, as a path.
        place: String,
        /// Why.
        cause: RleError,
    },
    /// A mask has another size than its image.
    #[error("{place} is {mask:?} (height, width), the image {image:?}")]
    Size {
        /// Where, as a path.
        place: String,
        /// Height and width of the mask.
        mask: [u32; 2],
        /// Height and width of the image.
        image: [u32; 2],
    },
    /// A COCO file with another number of images than one, where one is needed.
    #[error("the COCO file has {found} images where one is needed")]
    Images {
        /// Their number.
        found: usize,
    },
}

/// Reads the masks of one image in any of the formats.
///
/// # Errors
/// [`SegmentationError`] with the place of the first fault.
pub fn read_segmentation(text: &[u8]) -> Result<ImageSegmentation, SegmentationError> {
    let root = parse(text)?;
    match format_of(&root)? {
        SegmentationFormat::GroundedSam2 => read_grounded_sam2(&root),
        SegmentationFormat::SamAutomatic => read_sam_automatic(&root),
        SegmentationFormat::Coco => {
            let mut images = read_coco_images(&root)?;
            match images.len() {
                1 => Ok(images.remove(0)),
                found => Err(SegmentationError::Images { found }),
            }
        }
    }
}

/// Reads all images of a COCO file, in the order of their ids.
///
/// # Errors
/// [`SegmentationError`] with the place of the first fault.
pub fn read_coco(text: &[u8]) -> Result<Vec<ImageSegmentation>, SegmentationError> {
    let root = parse(text)?;
    match format_of(&root)? {
        SegmentationFormat::Coco => read_coco_images(&root),
        _ => Err(SegmentationError::Format { found: found(&root) }),
    }
}

fn parse(text: &[u8]) -> Result<Value, SegmentationError> {
    if text.len() > MAX_BYTES {
        return Err(SegmentationError::TooLong { bytes: text.len() });
    }
    serde_json::from_slice(text).map_err(|error| SegmentationError::Json { line: error.line(), column: error.column() })
}

fn format_of(root: &Value) -> Result<SegmentationFormat, SegmentationError> {
    let has = |key: &str| root.get(key).is_some();
    match () {
        () if has("images") && has("annotations") => Ok(SegmentationFormat::Coco),
        () if has("image") && has("annotations") => Ok(SegmentationFormat::SamAutomatic),
        () if has("img_width") && has("annotations") => Ok(SegmentationFormat::GroundedSam2),
        () => Err(SegmentationError::Format { found: found(root) }),
    }
}

fn found(root: &Value) -> String {
    match root {
        Value::Object(fields) => {
            let keys: Vec<String> = fields.keys().take(8).map(|key| format!("{:?}", cut(key))).collect();
            format!("the keys [{}]", keys.join(", "))
        }
        Value::Array(_) => "an array".into(),
        _ => "a single value".into(),
    }
}

fn read_grounded_sam2(root: &Value) -> Result<ImageSegmentation, SegmentationError> {
    let size = [side(root, "img_height", "")?, side(root, "img_width", "")?];
    let read = |annotation: &Value, place: &str| {
        let label = text(annotation, "class_name").ok_or_else(|| wrong(place, "class_name", "a text"))?;
        mask(annotation, place, size, label, score(annotation, "score", place)?)
    };
    let annotations = annotations(root)?;
    check_count(annotations.len())?;
    let masks = annotations.iter().enumerate().map(|(index, a)| read(a, &format!("annotations[{index}]")));
    Ok(ImageSegmentation {
        image: text(root, "image_path").unwrap_or_default(),
        width_px: size[1],
        height_px: size[0],
        masks: masks.collect::<Result<_, _>>()?,
    })
}

fn read_sam_automatic(root: &Value) -> Result<ImageSegmentation, SegmentationError> {
    let image = &root["image"];
    let size = [side(image, "height", "image.")?, side(image, "width", "image.")?];
    let read = |annotation: &Value, place: &str| {
        let label = text(annotation, "class_name").unwrap_or_else(|| UNKNOWN.into());
        mask(annotation, place, size, label, score(annotation, "predicted_iou", place)?)
    };
    let annotations = annotations(root)?;
    check_count(annotations.len())?;
    let masks = annotations.iter().enumerate().map(|(index, a)| read(a, &format!("annotations[{index}]")));
    Ok(ImageSegmentation {
        image: text(image, "file_name").unwrap_or_default(),
        width_px: size[1],
        height_px: size[0],
        masks: masks.collect::<Result<_, _>>()?,
    })
}

fn read_coco_images(root: &Value) -> Result<Vec<ImageSegmentation>, SegmentationError> {
    let list = |key: &str, expected| root[key].as_array().ok_or_else(|| wrong("", key, expected));
    let id_of = |value: &Value, key: &str, place: &str| {
        value[key].as_u64().ok_or_else(|| wrong(place, key, "a whole number, not negative"))
    };
    let mut names = std::collections::BTreeMap::new();
    for (index, category) in root["categories"].as_array().into_iter().flatten().enumerate() {
        let place = format!("categories[{index}]");
        let name = text(category, "name").ok_or_else(|| wrong(&place, "name", "a text"))?;
        names.insert(id_of(category, "id", &place)?, name);
    }
    let mut images = std::collections::BTreeMap::new();
    for (index, image) in list("images", "a list of images")?.iter().enumerate() {
        let place = format!("images[{index}]");
        let segmentation = ImageSegmentation {
            image: text(image, "file_name").unwrap_or_default(),
            width_px: side(image, "width", &format!("{place}."))?,
            height_px: side(image, "height", &format!("{place}."))?,
            masks: Vec::new(),
        };
        images.insert(id_of(image, "id", &place)?, segmentation);
    }
    for (index, annotation) in annotations(root)?.iter().enumerate() {
        let place = format!("annotations[{index}]");
        let image = images
            .get_mut(&id_of(annotation, "image_id", &place)?)
            .ok_or_else(|| wrong(&place, "image_id", "the id of an image of this file"))?;
        check_count(image.masks.len() + 1)?;
        let label = match annotation.get("category_id") {
            None => UNKNOWN.to_owned(),
            Some(id) => id
                .as_u64()
                .and_then(|id| names.get(&id).cloned())
                .ok_or_else(|| wrong(&place, "category_id", "the id of a category of this file"))?,
        };
        let size = [image.height_px, image.width_px];
        image.masks.push(mask(annotation, &place, size, label, score(annotation, "score", &place)?)?);
    }
    Ok(images.into_values().collect())
}

fn annotations(root: &Value) -> Result<&Vec<Value>, SegmentationError> {
    root["annotations"].as_array().ok_or_else(|| wrong("", "annotations", "a list of annotations"))
}

fn check_count(found: usize) -> Result<(), SegmentationError> {
    if found > MAX_ANNOTATIONS { Err(SegmentationError::TooMany { found }) } else { Ok(()) }
}

/// One annotation with what all formats have in common.
fn mask(annotation: &Value, place: &str, size: [u32; 2], label: String, score: f32) -> Result<Mask, SegmentationError> {
    let rle = read_mask(&annotation["segmentation"], &format!("{place}.segmentation"), size)?;
    Ok(Mask {
        caption: text(annotation, "caption").unwrap_or_default(),
        track: track(annotation, place)?,
        ..Mask::new(rle, label, score)
    })
}

/// RLE with a string or a list, or polygons.
fn read_mask(value: &Value, place: &str, size: [u32; 2]) -> Result<Rle, SegmentationError> {
    const FORMS: &str = "{\"size\": [H, W], \"counts\": string or list} or a list of polygons";
    let fault = |cause| SegmentationError::Mask { place: place.to_owned(), cause };
    let [height, width] = size;
    if let Value::Array(polygons) = value {
        let polygons: Option<Vec<Vec<[f64; 2]>>> = polygons.iter().map(read_polygon).collect();
        let polygons = polygons.ok_or_else(|| wrong(place, "", "a list of polygons [x1, y1, x2, y2, ...]"))?;
        return Rle::from_polygons(width, height, &polygons).map_err(fault);
    }
    let pair = value["size"].as_array().filter(|pair| pair.len() == 2).ok_or_else(|| wrong(place, "", FORMS))?;
    let sides: Option<Vec<u32>> = pair.iter().map(whole).collect();
    let sides = sides.ok_or_else(|| wrong(place, "size", "two whole numbers [H, W]"))?;
    if sides != size {
        return Err(SegmentationError::Size { place: place.to_owned(), mask: [sides[0], sides[1]], image: size });
    }
    match &value["counts"] {
        Value::String(counts) => Rle::from_coco_string(width, height, counts).map_err(fault),
        Value::Array(counts) => {
            let counts: Option<Vec<u32>> = counts.iter().map(whole).collect();
            let counts = counts.ok_or_else(|| wrong(place, "counts", "whole numbers, not negative"))?;
            Rle::from_counts(width, height, &counts).map_err(fault)
        }
        _ => Err(wrong(place, "counts", "a COCO string or a list of counts")),
    }
}

fn read_polygon(value: &Value) -> Option<Vec<[f64; 2]>> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    let numbers = numbers.filter(|numbers| numbers.len() % 2 == 0)?;
    Some(numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
}

fn side(value: &Value, key: &str, place: &str) -> Result<u32, SegmentationError> {
    whole(&value[key]).filter(|side| (1..=32768).contains(side)).ok_or_else(|| SegmentationError::Value {
        place: format!("{place}{key}"),
        expected: "a whole number of pixels from 1 to 32768",
    })
}

/// A whole number, also written as 3.0.
fn whole(value: &Value) -> Option<u32> {
    let from_float =
        || value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..=4294967295.0).contains(x)).map(|x| x as u32);
    value.as_u64().and_then(|x| u32::try_from(x).ok()).or_else(from_float)
}

/// A number, a list of one number, or nothing (then the mask counts fully).
fn score(annotation: &Value, key: &str, place: &str) -> Result<f32, SegmentationError> {
    let number = match &annotation[key] {
        Value::Null => Some(1.0),
        Value::Array(list) if list.len() == 1 => list[0].as_f64(),
        value => value.as_f64(),
    };
    number
        .map(|score| score.clamp(0.0, 1.0) as f32)
        .ok_or_else(|| wrong(place, key, "a number from 0 to 1, or a list of one"))
}

fn track(annotation: &Value, place: &str) -> Result<Option<u64>, SegmentationError> {
    let keys = ["object_id", "track_id", "instance_id"];
    let Some((key, value)) = keys.into_iter().find_map(|key| Some((key, annotation.get(key)?))) else {
        return Ok(None);
    };
    let number = match value {
        Value::Null => return Ok(None),
        Value::String(digits) => digits.parse().ok(),
        value => value.as_u64(),
    };
    number.map(Some).ok_or_else(|| wrong(place, key, "a whole number, not negative"))
}

fn text(value: &Value, key: &str) -> Option<String> {
    value.get(key)?.as_str().map(cut)
}

fn cut(text: &str) -> String {
    text.chars().take(MAX_TEXT).collect()
}

fn wrong(place: &str, key: &str, expected: &'static str) -> SegmentationError {
    let dot = if place.is_empty() || key.is_empty() { "" } else { "." };
    SegmentationError::Value { place: format!("{place}{dot}{key}"), expected }
}

/// Writes one image. COCO gives it the id 1 and its labels ids from 1 in the order of the alphabet.
pub fn write_segmentation(segmentation: &ImageSegmentation, format: SegmentationFormat) -> String {
    let value = match format {
        SegmentationFormat::GroundedSam2 => grounded_sam2(segmentation),
        SegmentationFormat::SamAutomatic => sam_automatic(segmentation),
        SegmentationFormat::Coco => coco(std::slice::from_ref(segmentation)),
    };
    value.to_string()
}

/// Writes a COCO file of several images, numbered from 1 in their order.
pub fn write_coco(images: &[ImageSegmentation]) -> String {
    coco(images).to_string()
}

fn grounded_sam2(segmentation: &ImageSegmentation) -> Value {
    let annotation = |mask: &Mask| {
        let [left, top, right, bottom] = mask.rle.bounds().unwrap_or_default();
        let mut value = common(mask);
        value.insert("class_name".into(), mask.label.as_str().into());
        value.insert("bbox".into(), json!([left, top, right, bottom]));
        value.insert("score".into(), number(mask.score));
        value
    };
    json!({
        "image_path": segmentation.image,
        "annotations": segmentation.masks.iter().map(annotation).collect::<Vec<_>>(),
        "box_format": "xyxy",
        "img_width": segmentation.width_px,
        "img_height": segmentation.height_px,
    })
}

fn sam_automatic(segmentation: &ImageSegmentation) -> Value {
    let annotation = |(index, mask): (usize, &Mask)| {
        let mut value = common(mask);
        value.insert("id".into(), index.into());
        value.insert("area".into(), mask.rle.area().into());
        value.insert("bbox".into(), corner_and_size(mask));
        value.insert("predicted_iou".into(), number(mask.score));
        value.insert("class_name".into(), mask.label.as_str().into());
        value
    };
    json!({
        "image": {
            "image_id": 1,
            "width": segmentation.width_px,
            "height": segmentation.height_px,
            "file_name": segmentation.image,
        },
        "annotations": segmentation.masks.iter().enumerate().map(annotation).collect::<Vec<_>>(),
    })
}

fn coco(images: &[ImageSegmentation]) -> Value {
    let mut names: Vec<&str> = images.iter().flat_map(|image| &image.masks).map(|mask| mask.label.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let mut annotations = Vec::new();
    for (image, segmentation) in images.iter().enumerate() {
        for mask in &segmentation.masks {
            let mut value = common(mask);
            value.insert("id".into(), (annotations.len() + 1).into());
            value.insert("image_id".into(), (image + 1).into());
            let category = names.partition_point(|name| *name < mask.label.as_str());
            value.insert("category_id".into(), (category + 1).into());
            value.insert("area".into(), mask.rle.area().into());
            value.insert("bbox".into(), corner_and_size(mask));
            value.insert("iscrowd".into(), 0.into());
            value.insert("score".into(), number(mask.score));
            annotations.push(value);
        }
    }
    let image = |(index, image): (usize, &ImageSegmentation)| json!({"id": index + 1, "width": image.width_px, "height": image.height_px, "file_name": image.image});
    json!({
        "images": images.iter().enumerate().map(image).collect::<Vec<_>>(),
        "categories": names.iter().enumerate().map(|(index, name)| json!({"id": index + 1, "name": name})).collect::<Vec<_>>(),
        "annotations": annotations,
    })
}

fn common(mask: &Mask) -> Map<String, Value> {
    let mut value = Map::new();
    let size = [mask.rle.height(), mask.rle.width()];
    value.insert("segmentation".into(), json!({"size": size, "counts": mask.rle.to_coco_string()}));
    if !mask.caption.is_empty() {
        value.insert("caption".into(), mask.caption.as_str().into());
    }
    if let Some(track) = mask.track {
        value.insert("object_id".into(), track.into());
    }
    value
}

fn corner_and_size(mask: &Mask) -> Value {
    let [left, top, right, bottom] = mask.rle.bounds().unwrap_or_default();
    json!([left, top, right - left, bottom - top])
}

/// The shortest decimal that is this single-precision number; JSON has no NaN.
fn number(x: f32) -> Value {
    x.to_string().parse::<f64>().ok().and_then(serde_json::Number::from_f64).map_or(json!(0.0), Value::Number)
}
