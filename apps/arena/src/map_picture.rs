//! The map from above, as one self-contained SVG: rooms in colours with their names, walls, places, objects, the path.

use std::fmt::Write;

use base64::Engine;
use mission::dsg::SceneGraph;
use mission::navigation::NavigationMap;
use mission::planner::Zone;
use mission::rooms::RoomMap;
use mission::volumetric_map::Cell;
use mission::zones::Zones;
use nalgebra::{Isometry3, Point2};

/// What to draw besides the graph.
#[derive(Debug, Clone, Default)]
pub struct MapDrawing<'a> {
    /// Rooms as cut from the map.
    pub rooms: Option<&'a RoomMap>,
    /// Height slice for walls where no room map exists.
    pub path: &'a [Point2<f64>],
    /// The true path in the frame of the map, dashed.
    pub true_path: &'a [Point2<f64>],
    /// Labels that the instruction names: drawn larger.
    pub nouns: &'a [String],
    /// Where the robot declared stop, or stands now.
    pub end: Option<Point2<f64>>,
    /// The object it decided for.
    pub target: Option<Point2<f64>>,
    /// Zones, in the map.
    pub zones: Option<&'a Zones>,
}

const PASTELS: [[u8; 3]; 12] = [
    [190, 216, 240],
    [250, 221, 180],
    [201, 231, 196],
    [240, 200, 205],
    [219, 206, 236],
    [250, 240, 180],
    [196, 232, 228],
    [233, 214, 196],
    [214, 224, 170],
    [240, 210, 235],
    [205, 213, 222],
    [255, 214, 196],
];

/// Draws the map. Axes are in metres, north up.
pub fn map_svg(graph: &SceneGraph, drawing: &MapDrawing) -> String {
    let mut low = Point2::new(f64::MAX, f64::MAX);
    let mut high = Point2::new(f64::MIN, f64::MIN);
    let mut include = |p: &Point2<f64>| {
        low = low.inf(p);
        high = high.sup(p);
    };
    for point in drawing.path {
        include(point);
    }
    for object in graph.objects() {
        include(&object.bounds.min.xy());
        include(&object.bounds.max.xy());
    }
    for place in graph.places() {
        include(&place.position.xy());
    }
    if let Some(rooms) = drawing.rooms {
        let grid = rooms.grid();
        for (cell, content) in grid.cells.iter().enumerate() {
            if *content == Cell::Free {
                include(&grid.center(cell % grid.width, cell / grid.width));
            }
        }
    }
    for (zone, ..) in drawing.zones.into_iter().flat_map(zones_of) {
        zone.corners().iter().for_each(&mut include);
    }
    if low.x > high.x {
        return "<p>Nothing was mapped.</p>".into();
    }
    let margin_m = 0.6;
    let (x0, y1) = (low.x - margin_m, high.y + margin_m);
    let (width_m, height_m) = (high.x - low.x + 2.0 * margin_m, high.y - low.y + 2.0 * margin_m);
    let x = |v: f64| v - x0;
    let y = |v: f64| y1 - v;
    let mut svg = format!(
        "<svg class=\"map\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width_m:.2} {height_m:.2}\" \
         style=\"width:100%;max-height:85vh;background:#f4f4f2\" font-family=\"sans-serif\">\n"
    );
    if let Some(rooms) = drawing.rooms {
        let grid = rooms.grid();
        let side_w = grid.width as f64 * grid.resolution_m;
        let side_h = grid.height as f64 * grid.resolution_m;
        let _ = writeln!(
            svg,
            "<image x=\"{:.3}\" y=\"{:.3}\" width=\"{side_w:.3}\" height=\"{side_h:.3}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{}\"/>",
            x(grid.origin.x),
            y(grid.origin.y + side_h),
            base64::engine::general_purpose::STANDARD.encode(room_png(rooms, graph))
        );
    }
    svg.push_str("<g class=\"places\" stroke=\"#8a8a8a\" stroke-width=\"0.02\" opacity=\"0.55\">\n");
    for edge in graph.place_edges() {
        if let (Some(a), Some(b)) = (graph.place(edge.a), graph.place(edge.b)) {
            let _ = writeln!(
                svg,
                "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\"/>",
                x(a.position.x),
                y(a.position.y),
                x(b.position.x),
                y(b.position.y)
            );
        }
    }
    for place in graph.places() {
        let (fill, radius) = if place.is_frontier() { ("#e07b00", 0.10) } else { ("#777777", 0.035) };
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"none\"><title>{} clearance {:.2} m</title></circle>",
            x(place.position.x),
            y(place.position.y),
            place.id,
            place.clearance_m
        );
    }
    svg.push_str("</g>\n<g class=\"objects\">\n");
    for object in graph.objects() {
        let is_named = drawing.nouns.iter().any(|noun| object.label.contains(noun.as_str()));
        let color = object.color.unwrap_or([120, 120, 120]);
        let (min, max) = (object.bounds.min, object.bounds.max);
        let opacity = if object.confirmed { 0.8 } else { 0.25 };
        let stroke = if is_named { "#c00000" } else { "#333333" };
        let _ = writeln!(
            svg,
            "<g opacity=\"{opacity}\"><rect x=\"{:.2}\" y=\"{:.2}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"rgb({},{},{})\" \
             stroke=\"{stroke}\" stroke-width=\"0.02\"/><title>{} {}: {} (seen {} times)</title>\
             <text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{}\" fill=\"{stroke}\" text-anchor=\"middle\" style=\"paint-order:stroke;\
             stroke:#ffffff;stroke-width:0.04px\">{}</text></g>",
            x(min.x),
            y(max.y),
            (max.x - min.x).max(0.03),
            (max.y - min.y).max(0.03),
            color[0],
            color[1],
            color[2],
            object.id,
            escape(&object.label),
            escape(&object.caption),
            object.observations,
            x(object.centroid.x),
            y(object.centroid.y) + 0.05,
            if is_named { 0.26 } else { 0.13 },
            escape(&object.label)
        );
    }
    svg.push_str("</g>\n");
    for (zone, name, color) in drawing.zones.into_iter().flat_map(zones_of) {
        let corners: String = zone.corners().iter().map(|p| format!("{:.2},{:.2} ", x(p.x), y(p.y))).collect();
        let _ = writeln!(
            svg,
            "<polygon class=\"zone\" points=\"{corners}\" fill=\"{color}\" fill-opacity=\"0.22\" stroke=\"{color}\" stroke-width=\"0.04\" \
             stroke-dasharray=\"0.2 0.08\"><title>{}</title></polygon>",
            escape(&name)
        );
    }
    let line =
        |points: &[Point2<f64>]| -> String { points.iter().map(|p| format!("{:.2},{:.2} ", x(p.x), y(p.y))).collect() };
    if !drawing.true_path.is_empty() {
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"#555555\" stroke-width=\"0.03\" stroke-dasharray=\"0.12 0.1\" opacity=\"0.7\"/>",
            line(drawing.true_path)
        );
    }
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#1f5fbf\" stroke-width=\"0.06\" stroke-linejoin=\"round\" opacity=\"0.85\"/>",
        line(drawing.path)
    );
    for room in graph.rooms() {
        let _ = writeln!(
            svg,
            "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"0.34\" font-weight=\"bold\" fill=\"#222\" text-anchor=\"middle\" \
             style=\"paint-order:stroke;stroke:#ffffff;stroke-width:0.08px\">{}</text>",
            x(room.center.x),
            y(room.center.y),
            escape(&room.name)
        );
    }
    let mut mark = |at: &Point2<f64>, color: &str, text: &str| {
        let _ = writeln!(
            svg,
            "<circle cx=\"{0:.2}\" cy=\"{1:.2}\" r=\"0.16\" fill=\"{color}\" stroke=\"#fff\" stroke-width=\"0.04\"/>\
             <text x=\"{0:.2}\" y=\"{2:.2}\" font-size=\"0.26\" font-weight=\"bold\" fill=\"{color}\" text-anchor=\"middle\" \
             style=\"paint-order:stroke;stroke:#ffffff;stroke-width:0.06px\">{text}</text>",
            x(at.x),
            y(at.y),
            y(at.y) - 0.24
        );
    };
    if let Some(start) = drawing.path.first() {
        mark(start, "#1a7f37", "start");
    }
    if let Some(end) = &drawing.end {
        mark(end, "#1f5fbf", "stop");
    }
    if let Some(target) = &drawing.target {
        mark(target, "#c00000", "target");
    }
    // A scale of one metre.
    let _ = writeln!(
        svg,
        "<g transform=\"translate(0.3 {:.2})\"><line x2=\"1\" stroke=\"#000\" stroke-width=\"0.05\"/><text x=\"0.5\" y=\"-0.1\" \
         font-size=\"0.22\" text-anchor=\"middle\">1 m</text></g>\n</svg>",
        height_m - 0.2
    );
    svg
}

/// Each zone with what it says and its colour.
fn zones_of(zones: &Zones) -> Vec<(&Zone, String, &'static str)> {
    let keep_out =
        zones.keep_out.iter().map(|keep_out| (&keep_out.zone, format!("keep out: {}", keep_out.name), "#c00000"));
    let speed = zones
        .speed
        .iter()
        .map(|slow| (&slow.zone.zone, format!("at most {} m/s: {}", slow.zone.max_mps, slow.name), "#c89000"));
    keep_out.chain(speed).collect()
}

/// Where this robot can go, as a picture: reachable green, free but too narrow or cut off pale, obstacles dark, the unmeasured grey.
pub fn navigation_img(navigation: &NavigationMap, here: &Point2<f64>) -> String {
    let grid = &navigation.grid;
    let reach = mission::reach::ReachMap::new(grid, here, navigation.clearance_m(), &navigation.gates());
    let mut image = image::RgbImage::new(grid.width.max(1) as u32, grid.height.max(1) as u32);
    for iy in 0..grid.height {
        for ix in 0..grid.width {
            let color = match grid.get(ix, iy) {
                Cell::Occupied => [60, 60, 64],
                Cell::Unknown => [200, 200, 200],
                Cell::Free if reach.is_reachable(ix, iy) => [150, 215, 150],
                Cell::Free => [245, 245, 230],
            };
            image.put_pixel(ix as u32, (grid.height - 1 - iy) as u32, image::Rgb(color));
        }
    }
    png_img(&image, "width:60%;image-rendering:pixelated")
}

/// A picture as an HTML element that holds it, drawn in this style; a sentence if it is empty.
pub fn png_img(image: &image::RgbImage, style: &str) -> String {
    let mut bytes = std::io::Cursor::new(Vec::new());
    if image.write_to(&mut bytes, image::ImageFormat::Png).is_err() {
        return "<p>There is nothing to see.</p>".into();
    }
    let text = base64::engine::general_purpose::STANDARD.encode(bytes.into_inner());
    format!("<img alt=\"\" style=\"{style}\" src=\"data:image/png;base64,{text}\">")
}

/// One pixel per cell: walls dark, rooms in the colour of their id, the unknown transparent.
fn room_png(rooms: &RoomMap, graph: &SceneGraph) -> Vec<u8> {
    let grid = rooms.grid();
    // The colour of a part is that of the graph's room there, so that it stays when parts are renumbered.
    let color_of_part: Vec<[u8; 3]> = rooms
        .rooms
        .iter()
        .enumerate()
        .map(|(index, shape)| {
            let id = graph
                .rooms()
                .min_by(|a, b| {
                    let distance = |r: &mission::dsg::Room| (r.center.xy() - shape.center).norm();
                    distance(a).total_cmp(&distance(b))
                })
                .map_or(index, |room| room.id.0 as usize);
            PASTELS[id % PASTELS.len()]
        })
        .collect();
    let mut image = image::RgbaImage::new(grid.width.max(1) as u32, grid.height.max(1) as u32);
    for iy in 0..grid.height {
        for ix in 0..grid.width {
            let pixel = match (grid.get(ix, iy), rooms.part_of_cell()[iy * grid.width + ix]) {
                (Cell::Occupied, _) => [70, 70, 74, 255],
                (Cell::Free, Some(part)) => {
                    let [r, g, b] = color_of_part[part as usize];
                    [r, g, b, 255]
                }
                (Cell::Free, None) => [235, 235, 235, 255],
                (Cell::Unknown, _) => [0, 0, 0, 0],
            };
            image.put_pixel(ix as u32, (grid.height - 1 - iy) as u32, image::Rgba(pixel));
        }
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    match image.write_to(&mut bytes, image::ImageFormat::Png) {
        Ok(()) => bytes.into_inner(),
        Err(_) => Vec::new(),
    }
}

/// Poses of the truth in the frame of the map: both began at the same place.
pub fn in_map(map_from_truth: &Isometry3<f64>, truth: &[Isometry3<f64>]) -> Vec<Point2<f64>> {
    truth.iter().map(|pose| (map_from_truth * pose).translation.vector.xy().into()).collect()
}

/// Text that may stand in HTML and SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_graph_is_said_to_be_empty_and_hostile_labels_are_harmless() {
        assert!(map_svg(&SceneGraph::new(), &MapDrawing::default()).contains("Nothing was mapped"));
        assert_eq!(escape("<script>\"&"), "&lt;script&gt;&quot;&amp;");
    }
}
