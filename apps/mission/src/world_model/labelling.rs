//! From masks to labels and evidence: each image waits for the scans around it.

use dsg::ObjectEvidence;
use nalgebra::{Isometry3, Point3};
use omni_perception::{MaskedPanorama, ObservationConfig, observe_objects};

use super::{RecentScan, WorldModel};
use crate::graph_builder::Sector;
use crate::people::moves_by_itself;
use crate::stage_clock::StageClock;

impl WorldModel {
    /// Labels the images around which all scans have come in.
    pub(super) fn label_waiting(&mut self, clock: &mut StageClock) {
        while let Some(panorama) = self.waiting.front() {
            let due = panorama.stamp.0 + (self.config.label_delay_s * 1e9) as i64;
            if self.odometry.as_ref().is_none_or(|newest| newest.stamp.0 < due) {
                return;
            }
            let panorama = self.waiting.pop_front().expect("it has a front");
            let world_from_camera = self.label(&panorama, clock);
            if let (Some(vision), Some(pose), Some(image)) = (&mut self.vision, world_from_camera, panorama.image) {
                vision.look(panorama.stamp, image, self.camera, pose);
            }
        }
    }

    /// One image: which point belongs to which mask, which object to which masks. Returns where it was taken, if it was used.
    fn label(&mut self, panorama: &MaskedPanorama, clock: &mut StageClock) -> Option<Isometry3<f64>> {
        let Some(world_from_body) = self.trajectory.world_from_body(panorama.stamp) else {
            self.ignored.images += 1;
            return None;
        };
        let world_from_camera = world_from_body * self.body_from_camera;
        let window_ns = (self.config.label_window_s * 1e9) as i64;
        let around = |scan: &&RecentScan| (scan.stamp.0 - panorama.stamp.0).abs() <= window_ns;
        // A second of scans shows what stands still better than one; who walks was elsewhere in most of them, before other things.
        const INSTANT_NS: i64 = 110_000_000;
        let mut points = Vec::new();
        for scan in self.recent.iter().filter(around) {
            let is_now = (scan.stamp.0 - panorama.stamp.0).abs() <= INSTANT_NS;
            match is_now || self.people.is_empty() {
                true => points.extend_from_slice(&scan.points_in_world),
                false => points.extend(self.people.without(&scan.points_in_world, scan.stamp)),
            }
        }
        if points.is_empty() {
            self.ignored.images += 1;
            return None;
        }
        let observations = clock.time("labels", || {
            observe_objects(panorama, &points, &world_from_camera, &self.camera, &ObservationConfig::default())
        });
        let mut votes = Vec::new();
        let mut evidence = Vec::with_capacity(observations.len());
        for observation in observations {
            let Some((label, _)) = observation.label_weights.first() else { continue };
            if moves_by_itself(label) {
                self.people.name(&observation);
                continue;
            }
            let next = self.label_ids.len() as u16 + 1;
            let id = *self.label_ids.entry(label.clone()).or_insert(next);
            votes.extend(observation.points_in_world.iter().map(|point| (*point, id)));
            evidence.push(ObjectEvidence {
                stamp_ns: observation.stamp.0,
                label_weights: observation.label_weights,
                caption: observation.caption,
                // A look from afar votes less than one from nearby (Eq. 4, departure in omni-perception's `vote`).
                score: observation.weight as f32,
                points: observation.points_in_world,
                color: observation.color_rgb,
                track: observation.track,
            });
        }
        clock.time("votes", || self.volume.vote_labels(&votes));
        let eye = world_from_camera * Point3::origin();
        let heading_rad = world_from_body.rotation.euler_angles().2;
        let view = Sector { eye, heading_rad, view_rad: self.config.view_rad };
        clock.time("objects", || {
            self.builder.observe(&mut self.graph, panorama.stamp.0, &evidence, &view, &self.volume)
        });
        self.ignored.changes += self.builder.take_refusals();
        self.coverage.look_in_sector(&eye.xy(), view.heading_rad, view.view_rad, &self.slice);
        Some(world_from_camera)
    }
}
