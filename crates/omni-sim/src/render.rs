//! A shaded panorama and the instance in every pixel, from far fewer rays than pixels.
//!
//! The picture is cut into blocks of 8 x 8 pixels. Rays are cast at the blocks' corners; a block whose four corners lie
//! on the same facet (coplanar triangles of one thing) is filled with the interpolated colour, others are quartered,
//! down to single pixels where different things meet (Warnock's subdivision with rays instead of polygons).
//!
//! Approximation, stated: a block can hide something that no corner sees. Things are kept from slipping through by
//! their boxes: where the box of a thing projects into a uniform block and may lie before what the corners see, the block
//! is split down to 2 pixels (things below 32 pixels) or 4 pixels (larger ones, for their legs). So things or parts
//! thinner than 2 or 4 pixels, and structure thinner than 8, may be broken or missing; borders inside one thing are exact to
//! 2 pixels in colour. `tests/panorama.rs` measures it against one ray a pixel.

use crate::bvh::RayStack;
use crate::equirect::Equirect;
use crate::mesh::InstanceId;
use crate::world::{Extent, Snapshot};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Colour and truth of a panorama.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// Geometry.
    pub view: Equirect,
    /// Row-major colour, three bytes a pixel.
    pub rgb: Vec<u8>,
    /// Column-major instances: pixel (column, row) at `column * height + row`; 0 for the structure and for nothing.
    pub instances: Vec<InstanceId>,
    /// Number of rays that were cast.
    pub rays: usize,
}

/// Renders what a camera at `world_from_camera` sees up to `max_range_m`; beyond it is black.
pub fn render(
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
    view: &Equirect,
    max_range_m: f64,
) -> Rendering {
    render_with_blocks(snapshot, world_from_camera, view, max_range_m, BLOCK)
}

/// The plain text of [`render`]: one ray a pixel. Slow; the oracle of the tests.
pub fn render_every_pixel(
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
    view: &Equirect,
    max_range_m: f64,
) -> Rendering {
    render_with_blocks(snapshot, world_from_camera, view, max_range_m, 1)
}

/// Coarsest distance of rays; 8 pixels are 1.5 degrees of a 1920 panorama.
pub(crate) const BLOCK: usize = 8;
/// Columns a task renders.
const STRIP: usize = 80;
/// Things that look smaller than this are looked for down to 2 pixels.
const SMALL_PX: f64 = 32.0;

fn render_with_blocks(
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
    view: &Equirect,
    max_range_m: f64,
    block: usize,
) -> Rendering {
    let (width, height) = (view.width as usize, view.height as usize);
    let eye = AllRound {
        columns: (0..width + block + 1).map(|x| unit(view.theta_rad(x as f64 + 0.5))).collect(),
        rows: (0..height + block + 1).map(|y| unit(view.phi_rad(y as f64 + 0.5))).collect(),
    };
    let boxes = match block {
        1 => Vec::new(),
        _ => boxes_in_view(snapshot, world_from_camera, |low, high| box_in_view(low, high, view)),
    };
    let picture = render_through(&eye, (width, height), snapshot, world_from_camera, max_range_m, block, boxes);
    Rendering { view: *view, rgb: picture.rgb, instances: picture.instances, rays: picture.rays }
}

/// Which way the pixels of a camera look.
pub(crate) trait Eye: Sync {
    /// Unit vector in the camera frame at the centre of pixel `(x, y)`, up to a block beyond the border; `None` where the
    /// lens shows nothing.
    fn direction(&self, x: usize, y: usize) -> Option<Vector3<f32>>;
}

/// A picture without its geometry, as in [`Rendering`].
pub(crate) struct Picture {
    pub(crate) rgb: Vec<u8>,
    pub(crate) instances: Vec<InstanceId>,
    rays: usize,
}

/// Renders through any eye. `boxes` are the things that could slip between the corners of a block.
pub(crate) fn render_through<E: Eye>(
    eye: &E,
    (width, height): (usize, usize),
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
    max_range_m: f64,
    block: usize,
    boxes: Vec<BoxInView>,
) -> Picture {
    let scene = Scene {
        snapshot,
        origin: Point3::from(world_from_camera.translation.vector).cast(),
        world_from_camera: world_from_camera.rotation.to_rotation_matrix().matrix().cast(),
        eye,
        max_range: max_range_m as f32,
        boxes,
        height,
        block,
    };
    let mut rendering = Picture { rgb: vec![0; 3 * width * height], instances: vec![0; width * height], rays: 0 };
    // A strip's columns are one piece of the column-major instances; its colours are copied row by row.
    let tiles: Vec<(usize, Vec<u8>)> = rendering
        .instances
        .par_chunks_mut(STRIP * height)
        .enumerate()
        .map_init(Samples::default, |samples, (index, instances)| {
            let mut strip = Strip::new(&scene, index * STRIP, samples, instances);
            strip.render();
            let rgb = strip.rgb;
            (samples.found.len(), rgb)
        })
        .collect();
    for (index, (rays, tile)) in tiles.iter().enumerate() {
        rendering.rays += rays;
        let x0 = index * STRIP;
        for (y, row) in tile.chunks_exact(tile.len() / height).enumerate() {
            let at = 3 * (y * width + x0);
            rendering.rgb[at..at + row.len()].copy_from_slice(row);
        }
    }
    rendering
}

/// Cosine and sine.
fn unit(angle: f64) -> (f32, f32) {
    (angle.cos() as f32, angle.sin() as f32)
}

/// The eye of a panorama.
struct AllRound {
    /// Cosine and sine of each column's azimuth and each row's elevation, some beyond the border.
    columns: Vec<(f32, f32)>,
    rows: Vec<(f32, f32)>,
}

impl Eye for AllRound {
    fn direction(&self, x: usize, y: usize) -> Option<Vector3<f32>> {
        let ((cos_theta, sin_theta), (cos_phi, sin_phi)) = (self.columns[x], self.rows[y]);
        Some(Vector3::new(cos_phi * cos_theta, cos_phi * sin_theta, sin_phi))
    }
}

struct Scene<'a, E> {
    snapshot: &'a Snapshot<'a>,
    origin: Point3<f32>,
    world_from_camera: Matrix3<f32>,
    eye: &'a E,
    max_range: f32,
    boxes: Vec<BoxInView>,
    height: usize,
    block: usize,
}

/// What a ray found.
#[derive(Clone, Copy)]
struct Sample {
    facet: u32,
    instance: InstanceId,
    range: f32,
    color: [f32; 3],
}

impl<E: Eye> Scene<'_, E> {
    fn sample(&self, x: usize, y: usize, stack: &mut RayStack) -> Sample {
        let Some(in_camera) = self.eye.direction(x, y) else {
            return Sample { facet: u32::MAX - 1, instance: 0, range: 0.0, color: [0.0; 3] };
        };
        let direction = self.world_from_camera * in_camera;
        match self.snapshot.cast(&self.origin, &direction, self.max_range, stack) {
            None => Sample { facet: u32::MAX, instance: 0, range: self.max_range, color: [0.0; 3] },
            Some((range, index)) => {
                let surface = self.snapshot.world().surface(index);
                let light = brightness(&self.snapshot.normal(index), &direction, range);
                Sample {
                    facet: surface.facet,
                    instance: surface.instance,
                    range,
                    color: surface.color.map(|c| f32::from(c) * light),
                }
            }
        }
    }
}

/// Two far lights, one at the camera, a little fog: enough for corners, round things and depth to be seen.
fn brightness(normal: &Vector3<f32>, direction: &Vector3<f32>, range: f32) -> f32 {
    let head = normal.dot(direction);
    // Towards the viewer.
    let n = if head > 0.0 { -normal } else { *normal };
    let sky = 0.5 + 0.5 * n.z;
    let side = 0.5 + 0.5 * (0.8 * n.x + 0.6 * n.y);
    let lit = 0.45 + 0.2 * sky + 0.2 * side + 0.15 * head.abs();
    lit / (1.0 + 0.02 * range)
}

/// Pixels `x0..x0 + width` of all rows.
struct Strip<'a, E> {
    scene: &'a Scene<'a, E>,
    x0: usize,
    width: usize,
    rgb: Vec<u8>,
    instances: &'a mut [InstanceId],
    samples: &'a mut Samples,
    stride: usize,
    /// Things whose boxes may be seen in this strip.
    boxes: Vec<&'a BoxInView>,
}

/// The samples of a strip; the memory goes from strip to strip.
#[derive(Default)]
struct Samples {
    found: Vec<Sample>,
    /// Index of the sample at each pixel, one block beyond the strip on the right and below.
    at: Vec<u32>,
    stack: RayStack,
}

const NO_SAMPLE: u32 = u32::MAX;

impl<'a, E: Eye> Strip<'a, E> {
    fn new(scene: &'a Scene<'a, E>, x0: usize, samples: &'a mut Samples, instances: &'a mut [InstanceId]) -> Self {
        let width = instances.len() / scene.height;
        let stride = width + scene.block + 1;
        samples.found.clear();
        samples.at.clear();
        samples.at.resize(stride * (scene.height + scene.block + 1), NO_SAMPLE);
        Strip {
            scene,
            x0,
            width,
            rgb: vec![0; 3 * width * scene.height],
            instances,
            samples,
            stride,
            boxes: scene.boxes.iter().filter(|b| b.overlaps_columns(x0, x0 + width + scene.block)).collect(),
        }
    }

    fn render(&mut self) {
        let block = self.scene.block;
        for y in (0..self.scene.height).step_by(block) {
            for x in (0..self.width).step_by(block) {
                self.fill_block(x, y, block);
            }
        }
    }

    /// Fills the block of `size` pixels whose upper left pixel is `(x, y)`, both within the strip.
    fn fill_block(&mut self, x: usize, y: usize, size: usize) {
        if x >= self.width || y >= self.scene.height {
            return;
        }
        if size == 1 {
            let sample = self.sample(x, y);
            self.put(x, y, &sample);
            return;
        }
        let corners =
            [self.sample(x, y), self.sample(x + size, y), self.sample(x, y + size), self.sample(x + size, y + size)];
        if size <= self.uniform_size(&corners, x, y, size) {
            self.interpolate(x, y, size, &corners);
            return;
        }
        let half = size / 2;
        for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
            self.fill_block(x + dx, y + dy, half);
        }
    }

    /// Largest size at which a block with these corners may be filled.
    fn uniform_size(&self, corners: &[Sample; 4], x: usize, y: usize, size: usize) -> usize {
        if corners.iter().any(|c| c.instance != corners[0].instance) {
            return 1;
        }
        if corners.iter().any(|c| c.facet != corners[0].facet) {
            return 2;
        }
        if size <= 2 {
            return size;
        }
        // On a plane the farthest point of a block is one of its corners.
        let farthest = corners.iter().map(|c| c.range).fold(0.0, f32::max);
        let (left, right) = (self.x0 + x, self.x0 + x + size);
        let mut allowed = self.scene.block;
        for thing in &self.boxes {
            if thing.nearest < farthest
                && thing.instance != corners[0].instance
                && allowed > thing.finest
                && thing.rows.0 <= y + size
                && thing.rows.1 >= y
                && thing.overlaps_columns(left, right)
            {
                allowed = thing.finest;
            }
        }
        allowed
    }

    fn sample(&mut self, x: usize, y: usize) -> Sample {
        let at = y * self.stride + x;
        let samples = &mut *self.samples;
        if samples.at[at] == NO_SAMPLE {
            let sample = self.scene.sample(self.x0 + x, y, &mut samples.stack);
            samples.at[at] = samples.found.len() as u32;
            samples.found.push(sample);
        }
        samples.found[samples.at[at] as usize]
    }

    fn interpolate(&mut self, x: usize, y: usize, size: usize, corners: &[Sample; 4]) {
        // Fixed point with 16 fractional bits: this loop touches nearly every pixel of the picture.
        let mut left = [0_i32; 3];
        let mut right = [0_i32; 3];
        let mut left_step = [0_i32; 3];
        let mut right_step = [0_i32; 3];
        let inverse = 65_536.0 / size as f32;
        let [a, b, c, d] = corners;
        for k in 0..3 {
            left[k] = (a.color[k] * 65_536.0) as i32;
            right[k] = (b.color[k] * 65_536.0) as i32;
            left_step[k] = ((c.color[k] - a.color[k]) * inverse) as i32;
            right_step[k] = ((d.color[k] - b.color[k]) * inverse) as i32;
        }
        let shift = size.trailing_zeros(); // blocks are powers of two
        let (columns, rows) = (size.min(self.width - x), size.min(self.scene.height - y));
        for j in 0..rows {
            let at = 3 * ((y + j) * self.width + x);
            let mut color = left;
            let slope = [(right[0] - left[0]) >> shift, (right[1] - left[1]) >> shift, (right[2] - left[2]) >> shift];
            for pixel in self.rgb[at..at + 3 * columns].chunks_exact_mut(3) {
                for k in 0..3 {
                    pixel[k] = (color[k] >> 16) as u8;
                    color[k] += slope[k];
                }
            }
            for k in 0..3 {
                left[k] += left_step[k];
                right[k] += right_step[k];
            }
        }
        for i in 0..columns {
            let at = (x + i) * self.scene.height + y;
            self.instances[at..at + rows].fill(corners[0].instance);
        }
    }

    fn put(&mut self, x: usize, y: usize, sample: &Sample) {
        let at = 3 * (y * self.width + x);
        for k in 0..3 {
            self.rgb[at + k] = sample.color[k] as u8;
        }
        self.instances[x * self.scene.height + y] = sample.instance;
    }
}

/// Where the box of a thing may be seen, and how near.
pub(crate) struct BoxInView {
    pub(crate) instance: InstanceId,
    pub(crate) nearest: f32,
    /// Finest block it asks for.
    pub(crate) finest: usize,
    /// First and last column, the first may be the larger one (over the seam).
    pub(crate) columns: (usize, usize),
    pub(crate) rows: (usize, usize),
}

impl BoxInView {
    /// Of a thing that looks `size_px` large at most.
    pub(crate) fn finest_of(size_px: f64) -> usize {
        if size_px < SMALL_PX { 2 } else { 4 }
    }

    fn overlaps_columns(&self, left: usize, right: usize) -> bool {
        let (first, last) = self.columns;
        if first <= last { first <= right && last >= left } else { last >= left || first <= right }
    }
}

/// The things of a snapshot whose boxes `place` finds in the picture; it gets the box round them in the camera frame.
pub(crate) fn boxes_in_view(
    snapshot: &Snapshot<'_>,
    world_from_camera: &Isometry3<f64>,
    place: impl Fn(&Vector3<f64>, &Vector3<f64>) -> Option<BoxInView>,
) -> Vec<BoxInView> {
    let camera_from_world: Isometry3<f32> = world_from_camera.inverse().cast();
    snapshot
        .world()
        .extents()
        .iter()
        .filter_map(|extent| {
            let camera_from_mesh = match extent.mover {
                Some(mover) => camera_from_world * snapshot.mover_pose(mover),
                None => camera_from_world,
            };
            let (low, high) = box_in_camera(extent, &camera_from_mesh);
            Some(BoxInView { instance: extent.instance, ..place(&low, &high)? })
        })
        .collect()
}

/// The box in camera axes around the box of a thing.
fn box_in_camera(extent: &Extent, camera_from_mesh: &Isometry3<f32>) -> (Vector3<f64>, Vector3<f64>) {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for i in 0..8 {
        let pick = |k: usize| {
            if i >> k & 1 == 0 { extent.low[k] } else { extent.high[k] }
        };
        let corner = camera_from_mesh * Point3::new(pick(0), pick(1), pick(2));
        let corner: Vector3<f64> = corner.coords.cast();
        low = low.inf(&corner);
        high = high.sup(&corner);
    }
    (low, high)
}

/// `None` when the box is wholly above or below the picture.
fn box_in_view(low: &Vector3<f64>, high: &Vector3<f64>, view: &Equirect) -> Option<BoxInView> {
    // Distances of the box from the camera: to its nearest point, and horizontally to its nearest and farthest.
    let gap = |k: usize| low[k].max(-high[k]).max(0.0);
    let near = gap(0).hypot(gap(1));
    let reach = |k: usize| low[k].abs().max(high[k].abs());
    let far = reach(0).hypot(reach(1));
    let nearest = near.hypot(gap(2));
    let phi = |z: f64, toward_pole: f64| z.atan2(if z * toward_pole > 0.0 { near } else { far });
    let row = |phi: f64| f64::from(view.height) * (view.phi_top_rad - phi) / (view.phi_top_rad - view.phi_bottom_rad);
    let (top, bottom) = (row(phi(high.z, 1.0)), row(phi(low.z, -1.0)));
    let last_row = f64::from(view.height);
    if bottom < 0.0 || top > last_row {
        return None;
    }
    let (columns, span) = columns_of(low, high, near, view);
    let size = span.max(bottom - top);
    Some(BoxInView {
        instance: 0, // the caller knows it
        nearest: nearest as f32,
        finest: BoxInView::finest_of(size),
        columns,
        rows: (top.max(0.0) as usize, bottom.min(last_row).ceil() as usize),
    })
}

/// Columns of a box and how many they are.
fn columns_of(low: &Vector3<f64>, high: &Vector3<f64>, near: f64, view: &Equirect) -> ((usize, usize), f64) {
    let width = f64::from(view.width);
    if near <= 0.0 {
        return ((0, view.width as usize), width);
    }
    let middle = (low + high) / 2.0;
    let center = middle.y.atan2(middle.x);
    let (mut left, mut right) = (0.0_f64, 0.0_f64);
    for (x, y) in [(low.x, low.y), (low.x, high.y), (high.x, low.y), (high.x, high.y)] {
        // Relative to the middle no angle passes half a turn, because the camera is outside.
        let turn = (y * center.cos() - x * center.sin()).atan2(x * center.cos() + y * center.sin());
        left = left.max(turn);
        right = right.min(turn);
    }
    let column = |theta: f64| width / 2.0 * (1.0 - theta / std::f64::consts::PI);
    let (first, last) = (column(center + left), column(center + right));
    let wrap = |u: f64| u.rem_euclid(width) as usize;
    ((wrap(first), wrap(last.ceil())), last - first)
}
