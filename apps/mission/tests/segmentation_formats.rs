//! Segmentation files of the usual tools: what is written is read again, small files written by hand are understood, and
//! whatever else comes is refused with its place.

use mission::omni_perception::{Mask, Rle};
use mission::segmentation_files::*;
use proptest::prelude::*;
use serde_json::{Value, json};

/// Ones in rows 1..3 of columns 0 and 1 of an image 3 wide and 4 high.
fn mask() -> Rle {
    Rle::from_counts(3, 4, &[1, 2, 2, 2, 5]).expect("twelve pixels")
}

fn read(value: &Value) -> Result<ImageSegmentation, SegmentationError> {
    read_segmentation(value.to_string().as_bytes())
}

fn grounded(annotation: Value) -> Value {
    json!({"image_path": "a.jpg", "annotations": [annotation], "box_format": "xyxy", "img_width": 3, "img_height": 4})
}

#[test]
fn grounded_sam_2_as_its_demonstration_writes_it() {
    let file = grounded(json!({
        "class_name": "mug",
        "bbox": [0.0, 1.0, 2.0, 3.0],
        "segmentation": {"size": [4, 3], "counts": "12203"},
        "score": [0.875],
    }));
    let segmentation = read(&file).expect("sound");
    assert_eq!((segmentation.image.as_str(), segmentation.width_px, segmentation.height_px), ("a.jpg", 3, 4));
    assert_eq!(segmentation.masks, [Mask::new(mask(), "mug", 0.875)]);
}

#[test]
fn sam_automatic_masks_have_no_name() {
    let file = json!({
        "image": {"image_id": 7, "width": 3, "height": 4, "file_name": "sa_7.jpg"},
        "annotations": [{
            "id": 1, "segmentation": {"size": [4, 3], "counts": [1, 2, 2, 2, 5]}, "area": 4, "bbox": [0, 1, 2, 2],
            "predicted_iou": 0.5, "stability_score": 0.9, "crop_box": [0, 0, 3, 4], "point_coords": [[1.5, 2.5]],
        }],
    });
    assert_eq!(read(&file).expect("sound").masks, [Mask::new(mask(), "unknown", 0.5)]);
}

#[test]
fn coco_with_polygons_lists_strings_and_several_images() {
    let annotation = |id: u32, image: u32, segmentation: Value| json!({"id": id, "image_id": image, "category_id": 2, "segmentation": segmentation, "iscrowd": 0});
    let images =
        [json!({"id": 1, "width": 3, "height": 4, "file_name": "b"}), json!({"id": 9, "width": 3, "height": 4})];
    let file = json!({
        "images": [images[1], images[0]],
        "categories": [{"id": 2, "name": "cup"}],
        "annotations": [
            annotation(1, 9, json!([[0.0, 1.0, 2.0, 1.0, 2.0, 3.0, 0.0, 3.0]])),
            annotation(2, 1, json!({"size": [4, 3], "counts": [1, 2, 2, 2, 5]})),
            annotation(3, 1, json!({"size": [4, 3], "counts": "12203"})),
        ],
    });
    let read = read_coco(file.to_string().as_bytes()).expect("sound");
    assert_eq!(read.iter().map(|image| image.masks.len()).collect::<Vec<_>>(), [2, 1], "images by id");
    for mask in read.iter().flat_map(|image| &image.masks) {
        assert_eq!(*mask, Mask::new(self::mask(), "cup", 1.0));
    }
    assert_eq!(read_segmentation(file.to_string().as_bytes()), Err(SegmentationError::Images { found: 2 }));
}

#[test]
fn video_numbers_and_captions_are_kept() {
    let annotation = |id: Value| json!({"class_name": "mug", "segmentation": {"size": [4, 3], "counts": "12203"}, "object_id": id, "caption": "red"});
    for id in [json!(12), json!("12")] {
        let read = read(&grounded(annotation(id))).expect("sound");
        assert_eq!((read.masks[0].track, read.masks[0].caption.as_str()), (Some(12), "red"));
    }
    assert_eq!(read(&grounded(annotation(json!(null)))).expect("sound").masks[0].track, None);
    assert!(read(&grounded(annotation(json!(-1)))).is_err());
}

fn refused(file: Value, place: &str) {
    let error = read(&file).expect_err(place).to_string();
    assert!(error.contains(place), "{error} does not name {place}");
}

#[test]
fn what_cannot_be_read_is_refused_with_its_place() {
    let with = |segmentation: Value| grounded(json!({"class_name": "mug", "segmentation": segmentation}));
    refused(json!([1, 2]), "an array");
    refused(json!({"detections": []}), "\"detections\"");
    refused(json!({"annotations": {}, "img_width": 3, "img_height": 4}), "annotations should be a list");
    refused(json!({"annotations": [], "img_width": 0, "img_height": 4}), "img_width");
    refused(json!({"annotations": [], "img_width": 3, "img_height": 40_000}), "img_height");
    refused(grounded(json!({"segmentation": {}})), "annotations[0].class_name");
    refused(with(json!(null)), "annotations[0].segmentation");
    refused(with(json!({"size": [4, 3]})), "annotations[0].segmentation.counts");
    refused(with(json!({"size": [3, 4], "counts": "12203"})), "[3, 4]");
    refused(with(json!({"size": [4, 3], "counts": "1220"})), "add up to");
    refused(with(json!({"size": [4, 3], "counts": "12 03"})), "character 2");
    refused(with(json!({"size": [4, 3], "counts": [1, -2]})), "counts");
    refused(with(json!({"size": [4, 3], "counts": [4_294_967_296_u64]})), "counts");
    refused(with(json!([[0.0, 1.0, 2.0]])), "polygons");
    refused(with(json!([["x", 1.0]])), "polygons");
    refused(
        grounded(json!({"class_name": "mug", "segmentation": {"size": [4, 3], "counts": "12203"}, "score": "high"})),
        "annotations[0].score",
    );
    let none = json!({"images": [], "annotations": [{"image_id": 3}]});
    refused(none, "annotations[0].image_id");
    assert!(matches!(read_segmentation(b"{\"annotations\": [}"), Err(SegmentationError::Json { line: 1, .. })));
    assert!(matches!(read_segmentation(&vec![b' '; MAX_BYTES + 1]), Err(SegmentationError::TooLong { .. })));
    let deep = "[".repeat(100_000);
    assert!(matches!(read_segmentation(deep.as_bytes()), Err(SegmentationError::Json { .. })));
    let many: Vec<Value> = (0..=MAX_ANNOTATIONS).map(|_| json!({})).collect();
    let many = json!({"annotations": many, "img_width": 3, "img_height": 4});
    assert_eq!(read(&many), Err(SegmentationError::TooMany { found: MAX_ANNOTATIONS + 1 }));
}

fn any_mask(width: u32, height: u32) -> impl Strategy<Value = Mask> {
    let pixels = prop::collection::vec(any::<bool>(), (width * height) as usize);
    (pixels, "[a-z ]{1,8}", 0.0..=1.0_f32, "[ -~]{0,12}", prop::option::of(any::<u64>())).prop_map(
        move |(pixels, label, score, caption, track)| {
            let rle = Rle::from_rows(width, height, &pixels).expect("all pixels");
            Mask { caption, track, ..Mask::new(rle, label, score) }
        },
    )
}

fn any_image() -> impl Strategy<Value = ImageSegmentation> {
    (1..9_u32, 1..9_u32).prop_flat_map(|(width_px, height_px)| {
        let masks = prop::collection::vec(any_mask(width_px, height_px), 0..5);
        let image = move |(image, masks)| ImageSegmentation { image, width_px, height_px, masks };
        ("[ -~]{0,12}", masks).prop_map(image)
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_again(image in any_image(), other in any_image()) {
        for format in [SegmentationFormat::GroundedSam2, SegmentationFormat::SamAutomatic, SegmentationFormat::Coco] {
            let text = write_segmentation(&image, format);
            prop_assert_eq!(&read_segmentation(text.as_bytes()).expect("our own"), &image, "{:?}", format);
        }
        let images = vec![image, other];
        prop_assert_eq!(read_coco(write_coco(&images).as_bytes()).expect("our own"), images);
    }

    #[test]
    fn damaged_files_never_panic(image in any_image(), at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<bool>()) {
        for format in [SegmentationFormat::GroundedSam2, SegmentationFormat::SamAutomatic, SegmentationFormat::Coco] {
            let mut text = write_segmentation(&image, format).into_bytes();
            let at = at.index(text.len());
            if cut { text.truncate(at) } else { text[at] = byte }
            let _ = read_segmentation(&text);
        }
    }
}
