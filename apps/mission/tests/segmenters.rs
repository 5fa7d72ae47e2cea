//! Segmenters that are files or services: they get the picture and the words, they may fail in every way, the wait is bounded,
//! and the next picture is another matter.

mod support;

use std::time::{Duration, Instant};

use base64::Engine;
use mission::http_post::PostError;
use mission::omni_perception::{Mask, MaskedPanorama, RgbImage, Rle, Stamp};
use mission::segmentation_files::{ImageSegmentation, SegmentationFormat, write_segmentation};
use mission::segmenter::{SegmentRequest, Segmenter, SegmenterError};
use mission::segmenter_folder::FolderSegmenter;
use mission::segmenter_http::{HttpSegmenter, HttpSegmenterConfig};
use serde_json::json;
use support::{Answer, FakeService};

const WIDTH: u32 = 6;
const HEIGHT: u32 = 4;

fn picture() -> RgbImage {
    RgbImage { width: WIDTH, height: HEIGHT, rgb: (0..3 * WIDTH * HEIGHT).map(|i| (i * 7) as u8).collect() }
}

fn mask() -> Mask {
    Mask { track: Some(3), ..Mask::new(Rle::from_counts(WIDTH, HEIGHT, &[5, 3, 16]).expect("24 pixels"), "mug", 0.75) }
}

fn answer(format: SegmentationFormat) -> String {
    let image = String::new();
    write_segmentation(&ImageSegmentation { image, width_px: WIDTH, height_px: HEIGHT, masks: vec![mask()] }, format)
}

fn ask(segmenter: &mut dyn Segmenter, stamp_ns: i64) -> Result<MaskedPanorama, SegmenterError> {
    let (phrases, standing) = (["mug".to_owned()], ["chair".to_owned(), "door".to_owned()]);
    let stamp = Stamp(stamp_ns);
    segmenter.segment(SegmentRequest { stamp, image: picture(), phrases: &phrases, standing: &standing })
}

fn service(url: &str) -> HttpSegmenter {
    HttpSegmenter::new(HttpSegmenterConfig { timeout_s: 5.0, attempts: 1, ..HttpSegmenterConfig::new(url) })
}

#[test]
fn a_service_gets_picture_and_words_and_its_masks_come_back() {
    let formats = [SegmentationFormat::GroundedSam2, SegmentationFormat::SamAutomatic, SegmentationFormat::Coco];
    let fake = FakeService::start(move |number, _| Answer::Say("200 OK", answer(formats[number]).into_bytes()));
    let mut segmenter = service(&fake.url);
    const STAMP_NS: i64 = 1_532_402_927_612_460_001; // more digits than an f64 has
    for _ in formats {
        let panorama = ask(&mut segmenter, STAMP_NS).expect("a good answer");
        assert_eq!(panorama, MaskedPanorama { stamp: Stamp(STAMP_NS), masks: vec![mask()], image: Some(picture()) });
    }
    let request = &fake.requests()[0];
    assert_eq!((&request["version"], &request["stamp_ns"]), (&json!(1), &json!(STAMP_NS.to_string())));
    assert_eq!((&request["phrases"], &request["standing"]), (&json!(["mug"]), &json!(["chair", "door"])));
    let image = &request["image"];
    assert_eq!((&image["width"], &image["height"], &image["encoding"]), (&json!(WIDTH), &json!(HEIGHT), &json!("png")));
    let data = image["data"].as_str().expect("base64");
    let png = base64::engine::general_purpose::STANDARD.decode(data).expect("base64");
    let decoded = image::load_from_memory(&png).expect("a picture").to_rgb8();
    assert_eq!(decoded.into_raw(), picture().rgb, "the picture is sent without loss");
}

#[test]
fn every_failure_has_its_own_sentence_and_the_next_picture_is_asked_for() {
    let large = json!({"image_path": "", "annotations": [], "img_width": WIDTH, "img_height": 99}).to_string();
    let answers: Vec<fn() -> Answer> = vec![
        || Answer::Say("500 Internal Server Error", b"out of memory".to_vec()),
        || Answer::Say("404 Not Found", b"no such model".to_vec()),
        || Answer::Say("200 OK", b"<html>not JSON</html>".to_vec()),
        || Answer::Say("200 OK", br#"{"annotations": "none"}"#.to_vec()),
        || Answer::Say("200 OK", vec![b'[', 0xff, 0x00]),
        || Answer::CutOff(br#"{"annotations": ["#.to_vec()),
    ];
    let count = answers.len();
    let fake = FakeService::start(move |number, _| match number {
        n if n < answers.len() => answers[n](),
        n if n == answers.len() => Answer::Say("200 OK", large.clone().into_bytes()),
        _ => Answer::Say("200 OK", answer(SegmentationFormat::GroundedSam2).into_bytes()),
    });
    let config = HttpSegmenterConfig { attempts: 1, patience: 100, ..HttpSegmenterConfig::new(&fake.url) };
    let mut segmenter = HttpSegmenter::new(config);
    let mut failures: Vec<SegmenterError> = (0..=count).map(|_| ask(&mut segmenter, 1).expect_err("bad")).collect();
    let mut sentences: Vec<String> = failures.iter().map(ToString::to_string).collect();
    sentences.sort();
    sentences.dedup();
    assert_eq!(sentences.len(), count + 1, "{sentences:#?}");
    assert!(matches!(failures[0], SegmenterError::Service(PostError::Status { status: 500, .. })));
    assert!(matches!(failures.remove(count), SegmenterError::Size { masks: [WIDTH, 99], .. }));
    assert_eq!(ask(&mut segmenter, 2).expect("it is well again").masks, [mask()]);

    let broken = RgbImage { rgb: vec![0; 5], ..picture() };
    let request = SegmentRequest { stamp: Stamp(0), image: broken, phrases: &[], standing: &[] };
    assert!(matches!(segmenter.segment(request), Err(SegmenterError::Picture { bytes: 5, .. })));
    assert!(ask(&mut service("https://elsewhere"), 0).expect_err("no plain HTTP").to_string().contains("http://"));
}

#[test]
fn an_answer_without_end_is_not_read_to_the_end() {
    let fake = FakeService::start(|_, _| Answer::Say("200 OK", vec![b' '; (33 << 20) + 1]));
    let error = ask(&mut service(&fake.url), 0).expect_err("too long");
    assert!(matches!(error, SegmenterError::Service(PostError::TooLong { .. })), "{error}");
}

#[test]
fn slow_and_silent_services_end_at_the_deadline() {
    for fake in
        [FakeService::start(|_, _| Answer::Silence(Duration::from_secs(60))), FakeService::start(|_, _| Answer::Drip)]
    {
        let config = HttpSegmenterConfig { timeout_s: 0.3, attempts: 2, ..HttpSegmenterConfig::new(&fake.url) };
        let start = Instant::now();
        let error = ask(&mut HttpSegmenter::new(config), 0).expect_err("slow");
        assert!(matches!(error, SegmenterError::Service(PostError::Timeout(_))), "{error}");
        assert!(start.elapsed() < Duration::from_secs(10), "two tries of 0.3 s took {:?}", start.elapsed());
        assert_eq!(fake.requests().len(), 2);
    }
}

#[test]
fn a_service_that_is_down_is_left_alone_longer_and_longer() {
    let fake = FakeService::start(|number, _| match number {
        0..7 => Answer::Say("503 Service Unavailable", Vec::new()),
        _ => Answer::Say("200 OK", answer(SegmentationFormat::GroundedSam2).into_bytes()),
    });
    let config =
        HttpSegmenterConfig { attempts: 1, patience: 2, longest_rest: 4, ..HttpSegmenterConfig::new(&fake.url) };
    let mut segmenter = HttpSegmenter::new(config);
    let said: String = (0..30)
        .map(|_| match ask(&mut segmenter, 0) {
            Ok(_) => '+',
            Err(SegmenterError::Resting { .. }) => '.',
            Err(_) => 'x',
        })
        .collect();
    // Two failures, then a rest of 1, 2, 4, 4, ... images before each further try.
    assert_eq!(said, "xx.x..x....x....x....x....++++");
    assert_eq!(fake.requests().len(), 11);
    let error = ask(&mut service(&FakeService::down()), 0).expect_err("down");
    assert!(matches!(error, SegmenterError::Service(PostError::Unreachable { .. })), "{error}");
}

#[test]
fn one_failure_on_the_way_is_tried_again_and_a_refusal_is_not() {
    let fake = FakeService::start(|number, _| match number {
        0 => Answer::CutOff(Vec::new()),
        1 => Answer::Say("200 OK", answer(SegmentationFormat::GroundedSam2).into_bytes()),
        _ => Answer::Say("400 Bad Request", Vec::new()),
    });
    let config = HttpSegmenterConfig { attempts: 3, ..HttpSegmenterConfig::new(&fake.url) };
    let mut segmenter = HttpSegmenter::new(config);
    ask(&mut segmenter, 0).expect("the second try");
    ask(&mut segmenter, 0).expect_err("refused");
    assert_eq!(fake.requests().len(), 3);
}

#[test]
fn files_beside_a_recording_are_found_by_time() {
    let folder = tempfile::tempdir().expect("a place");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("panorama_1000000000.json", &answer(SegmentationFormat::GroundedSam2));
    write("1500000000.json", &answer(SegmentationFormat::Coco));
    write("2000000000.json", "{");
    write("index.json", "{}");
    write("1500000000.png", "");
    let mut segmenter = FolderSegmenter::open(folder.path()).expect("a folder");
    assert_eq!((segmenter.len(), segmenter.is_empty()), (3, false));
    for stamp_ns in [1_000_000_000, 1_500_000_000, 1_499_996_000, 1_504_000_000] {
        let panorama = ask(&mut segmenter, stamp_ns).expect("a file");
        assert_eq!((panorama.stamp, panorama.masks), (Stamp(stamp_ns), vec![mask()]));
    }
    assert_eq!(ask(&mut segmenter, 1_250_000_000), Err(SegmenterError::NoFile { stamp_ns: 1_250_000_000 }));
    assert_eq!(ask(&mut segmenter, i64::MIN), Err(SegmenterError::NoFile { stamp_ns: i64::MIN }));
    assert!(matches!(ask(&mut segmenter, 2_000_000_000), Err(SegmenterError::Answer(_))));
    assert!(matches!(FolderSegmenter::open(&folder.path().join("none")), Err(SegmenterError::File { .. })));
}
