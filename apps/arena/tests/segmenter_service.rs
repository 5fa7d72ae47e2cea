//! A mission's pictures go to a segmenter behind HTTP with the nouns of its instruction, and a service that fails stops nobody.

mod support;

use arena::mission::robot_model::RobotKind;
use arena::mission::segmenter_http::HttpSegmenterConfig;
use serde_json::Value;
use support::fake_server::{Answer, FakeServer};
use support::{coarse, scene, short_run};

#[test]
fn the_service_is_asked_for_the_nouns_of_the_instruction_and_its_silence_is_told() {
    let server = FakeServer::start(|_, _| Answer::Raw("500 Internal Server Error", b"out of memory".to_vec()));
    let mut config = coarse(4.0);
    config.segmenter =
        Some(HttpSegmenterConfig { timeout_s: 2.0, attempts: 1, ..HttpSegmenterConfig::new(&server.base_url) });
    let result =
        short_run(&config, RobotKind::Ground, &scene("flat"), "find the mug near the sink, then go to the bed", 1);
    let requests = server.requests();
    assert!(!requests.is_empty(), "no picture was sent");
    for request in &requests {
        let words = |key: &str| -> Vec<&str> {
            request[key].as_array().expect("a list").iter().filter_map(Value::as_str).collect()
        };
        for noun in ["mug", "sink", "bed"] {
            assert!(words("phrases").contains(&noun), "{noun} in {:?}", words("phrases"));
        }
        assert!(words("standing").contains(&"door"));
        assert_eq!(request["image"]["encoding"], "png");
    }
    // Pictures without masks are left out and told; nothing is made up in their place.
    let summary = &result.summary;
    assert!(summary.images > 0 && summary.images_without_masks == summary.images, "{}", summary.images_without_masks);
    assert!(summary.segmenter_error.as_ref().is_some_and(|error| error.contains("segmenter")));
    assert_eq!(summary.objects_found, 0);
}
