//! Places and edges as most are: nothing in them but what we have fields for. They are nine tenths of a file, and are read and
//! written without a tree. What is more than this, or wrong, is left to the readers that know every case ([`super::read`]).

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::ids::PlaceId;
use crate::place::Place;
use crate::spark::attributes::NO_LABEL;
use crate::spark::{MAX_INDEX, PLACE};

/// A place as most are: nothing in it but what we have fields for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaceText<'a> {
    id: u64,
    layer: u8,
    #[serde(default)]
    partition: u32,
    #[serde(borrow)]
    attributes: PlaceAttributesText<'a>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceAttributesText<'a> {
    r#type: &'a str,
    position: [f64; 3],
    distance: f64,
    num_basis_points: u8,
    #[serde(default)]
    active_frontier: bool,
    #[serde(default)]
    anti_frontier: bool,
    #[serde(default)]
    is_active: bool,
    #[serde(default)]
    is_predicted: bool,
    #[serde(default)]
    need_cleanup: bool,
    #[serde(default)]
    real_place: Option<bool>,
    #[serde(default)]
    last_update_time_ns: u64,
    #[serde(default)]
    num_frontier_voxels: u32,
    #[serde(default)]
    name: &'a str,
    #[serde(default)]
    semantic_label: Option<u32>,
    #[serde(default, rename = "color")]
    _color: Option<Black>,
    #[serde(default, rename = "bounding_box")]
    bounds: Option<NoBox<'a>>,
    #[serde(default, rename = "semantic_feature")]
    _feature: Option<NoFeature>,
    #[serde(default)]
    orientation: Option<Turn>,
    #[serde(default)]
    frontier_scale: [f64; 3],
    #[serde(default, rename = "metadata")]
    _metadata: Option<NoFields>,
    #[serde(default, rename = "deformation_connections")]
    _deformation: Option<[u8; 0]>,
    #[serde(default, rename = "mesh_vertex_labels")]
    _labels: Option<[u8; 0]>,
    #[serde(default, rename = "pcl_mesh_connections")]
    _pcl: Option<[u8; 0]>,
    #[serde(default, rename = "voxblox_mesh_connections")]
    _voxblox: Option<[u8; 0]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoFields {}

#[derive(Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Black {
    r: u8,
    g: u8,
    b: u8,
    a: u8,
}

#[derive(Deserialize)]
struct NoBox<'a> {
    #[serde(borrow)]
    r#type: &'a str,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoFeature {
    rows: u32,
    #[serde(rename = "cols")]
    _cols: u32,
    #[serde(rename = "data")]
    _data: (),
}

#[derive(Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Turn {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

impl PlaceText<'_> {
    /// The place, if there is nothing more to it.
    pub fn place(self) -> Option<(u64, Place)> {
        let a = self.attributes;
        let is_plain = self.layer == 3
            && self.partition == 0
            && a.r#type == "PlaceNodeAttributes"
            && !(a.anti_frontier || a.is_active || a.is_predicted || a.need_cleanup)
            && a.active_frontier == (a.num_frontier_voxels > 0)
            && a.real_place.is_none_or(|real| real)
            && a.last_update_time_ns == 0
            && a.name.is_empty()
            && a.semantic_label.is_none_or(|label| label == NO_LABEL)
            && a._color.is_none_or(|color| color == Black { r: 0, g: 0, b: 0, a: 255 })
            && a.bounds.is_none_or(|bounds| bounds.r#type == "INVALID")
            && a._feature.is_none_or(|feature| feature.rows == 0)
            && a.orientation.is_none_or(|turn| turn == Turn { w: 1.0, x: 0.0, y: 0.0, z: 0.0 })
            && a.frontier_scale == [0.0; 3]
            && a.distance >= 0.0
            && self.id >> 56 == u64::from(PLACE);
        let place = Place {
            id: PlaceId(self.id & (MAX_INDEX - 1)),
            position: Point3::from(a.position),
            clearance_m: a.distance,
            basis_points: a.num_basis_points,
            frontier_cells: a.num_frontier_voxels,
            room: None,
        };
        is_plain.then_some((self.id, place))
    }
}

/// An edge as most are.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EdgeText<'a> {
    pub source: u64,
    pub target: u64,
    #[serde(borrow)]
    pub info: InfoText<'a>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InfoText<'a> {
    pub r#type: &'a str,
    #[serde(default)]
    pub weighted: bool,
    #[serde(default)]
    pub weight: Option<f64>,
    #[serde(default, rename = "metadata")]
    _metadata: Option<NoFields>,
}

/// A record as most are, or nothing. The text is checked once as a whole, not string by string.
pub(super) fn plain<'a, T: Deserialize<'a>>(text: &'a [u8]) -> Option<T> {
    serde_json::from_str(std::str::from_utf8(text).ok()?).ok()
}

/// A place as we write it if there is nothing more to it.
#[derive(Serialize)]
pub(super) struct PlaceOut {
    pub attributes: PlaceAttributesOut,
    pub id: u64,
    pub layer: u8,
    pub partition: u8,
}

#[derive(Serialize)]
pub(super) struct PlaceAttributesOut {
    pub distance: f64,
    pub num_basis_points: u8,
    pub position: [f64; 3],
    pub r#type: &'static str,
}

/// An edge as we write it if there is nothing more to it.
#[derive(Serialize)]
pub(super) struct EdgeOut {
    pub info: InfoOut,
    pub source: u64,
    pub target: u64,
}

#[derive(Serialize)]
pub(super) struct InfoOut {
    pub r#type: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub weighted: bool,
}
