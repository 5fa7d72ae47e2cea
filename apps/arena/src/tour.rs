//! A tour of a building: a way through every room and back to where it began.
//!
//! A recording is meant to teach and to measure, so it should show the whole building, from near enough, in one piece, and come
//! back to its start, where the drift of an odometry shows. A mission would not do: it ends where its thing is found, and
//! which rooms it saw depends on how well it reasoned that day. So the way is planned on the true floor.

use nalgebra::Point2;
use omni_sim::building::Building;

use omni_sim::floor::TrueFloor;

/// No place of a room is farther than this from a stop, where the robot fits there.
const STOP_SPACING_M: f64 = 3.0;
/// Room beside the robot that is kept if every room can be reached with it, else the next.
const MARGINS_M: [f64; 4] = [0.15, 0.10, 0.06, 0.02];

/// Where there is less room than this beside the robot, the way costs more ...
const WIDE_M: f64 = 0.3;
/// ... up to so much more for a metre without any.
const NARROW_COST: f64 = 3.0;

/// A planned way.
#[derive(Debug, Clone, PartialEq)]
pub struct Tour {
    /// Points of the way, about half a decimetre apart.
    pub way: Vec<Point2<f64>>,
    /// Room beside the robot's circle at each of them.
    pub room_m: Vec<f64>,
    /// Rooms with a stop, in the order of visits.
    pub rooms: Vec<u32>,
    /// Its length.
    pub length_m: f64,
}

impl Tour {
    /// Plans for a robot that sweeps a circle of `radius_m`, from the cell nearest to `start`. `None` if the robot fits nowhere.
    pub fn plan(floor: &TrueFloor, building: &Building, radius_m: f64, start: &Point2<f64>) -> Option<Tour> {
        let plans = MARGINS_M.map(|margin_m| Plan::new(floor, building, radius_m, margin_m, start));
        // The widest margin that costs no room.
        let most = plans.iter().flatten().map(|plan| plan.rooms_with_stop()).max()?;
        let plan = plans.into_iter().flatten().find(|plan| plan.rooms_with_stop() == most)?;
        Some(plan.visit_all())
    }
}

/// Stops and what reaches them.
struct Plan<'a> {
    floor: &'a TrueFloor,
    /// Radius of the robot's circle, without and with the margin.
    robot_m: f64,
    radius_m: f64,
    start: usize,
    /// Cell and room.
    stops: Vec<(usize, u32)>,
}

impl<'a> Plan<'a> {
    fn new(
        floor: &'a TrueFloor,
        building: &Building,
        robot_m: f64,
        margin_m: f64,
        start: &Point2<f64>,
    ) -> Option<Plan<'a>> {
        let radius_m = robot_m + margin_m;
        let fits = |cell: &usize| floor.clearance_m(*cell) >= radius_m;
        let start = (0..floor.len()).filter(fits).min_by(|a, b| {
            let distance_m = |cell: usize| (floor.center_of(cell) - start).norm();
            distance_m(*a).total_cmp(&distance_m(*b))
        })?;
        let reach_m = floor.distances_from(&[start], radius_m);
        let mut stops = Vec::new();
        for room in building.rooms.iter().filter(|room| (room.floor_z_m - floor.floor_z_m).abs() < 0.1) {
            let cells: Vec<usize> = (0..floor.len())
                .filter(|cell| reach_m[*cell].is_finite() && room.contains(&floor.center_of(*cell)))
                .collect();
            stops.extend(stops_of(floor, &cells).into_iter().map(|cell| (cell, room.id)));
        }
        Some(Plan { floor, robot_m, radius_m, start, stops })
    }

    fn rooms_with_stop(&self) -> usize {
        let mut rooms: Vec<u32> = self.stops.iter().map(|(_, room)| *room).collect();
        rooms.dedup();
        rooms.len()
    }

    /// The middle of a passage is cheaper than its edge: there the robot is quick and touches nothing.
    fn weight(&self, cell: usize) -> f64 {
        let room_m = self.floor.clearance_m(cell) - self.robot_m;
        1.0 + NARROW_COST * (1.0 - room_m / WIDE_M).clamp(0.0, 1.0)
    }

    fn costs_from(&self, cell: usize) -> Vec<f64> {
        self.floor.costs_from(&[cell], self.radius_m, |cell| self.weight(cell))
    }

    fn way_to(&self, costs: &[f64], goal: usize) -> Vec<usize> {
        self.floor.way_to(costs, goal, |cell| self.weight(cell))
    }

    /// Always to the nearest stop that is left, and home at the end.
    fn visit_all(mut self) -> Tour {
        let (mut here, mut cells, mut rooms) = (self.start, vec![self.start], Vec::new());
        while !self.stops.is_empty() {
            let costs = self.costs_from(here);
            let nearest = (0..self.stops.len())
                .min_by(|a, b| costs[self.stops[*a].0].total_cmp(&costs[self.stops[*b].0]))
                .expect("not empty");
            let (cell, room) = self.stops.remove(nearest);
            cells.extend(self.way_to(&costs, cell).into_iter().skip(1));
            rooms.push(room);
            here = cell;
        }
        rooms.dedup();
        cells.extend(self.way_to(&self.costs_from(here), self.start).into_iter().skip(1));
        let way: Vec<Point2<f64>> = cells.iter().map(|cell| self.floor.center_of(*cell)).collect();
        let room_m = cells.iter().map(|cell| self.floor.clearance_m(*cell) - self.robot_m).collect();
        let length_m = way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        Tour { way, room_m, rooms, length_m }
    }
}

/// The roomiest cell first, then always the one farthest from all stops until none is far.
fn stops_of(floor: &TrueFloor, cells: &[usize]) -> Vec<usize> {
    let roomiest = cells.iter().copied().max_by(|a, b| {
        // The first of equals, whatever the iterator prefers.
        floor.clearance_m(*a).total_cmp(&floor.clearance_m(*b)).then(b.cmp(a))
    });
    let mut stops: Vec<usize> = roomiest.into_iter().collect();
    while !stops.is_empty() {
        let distance_m = |cell: usize| {
            let to = |stop: &usize| (floor.center_of(cell) - floor.center_of(*stop)).norm();
            stops.iter().map(to).fold(f64::INFINITY, f64::min)
        };
        let farthest = cells.iter().copied().max_by(|a, b| distance_m(*a).total_cmp(&distance_m(*b)).then(b.cmp(a)));
        match farthest {
            Some(cell) if distance_m(cell) > STOP_SPACING_M => stops.push(cell),
            _ => break,
        }
    }
    stops
}

#[cfg(test)]
mod tests {
    use super::*;
    use omni_sim::scenes::named_scene;

    #[test]
    fn every_room_is_visited_and_the_way_keeps_its_distance_and_ends_where_it_began() {
        let building = named_scene("flat").unwrap();
        let floor = TrueFloor::new(&building, 0, 0.1, 0.6);
        let start = building.rooms[0].center();
        let tour = Tour::plan(&floor, &building, 0.35, &start).unwrap();
        let mut rooms = tour.rooms.clone();
        rooms.sort_unstable();
        rooms.dedup();
        assert_eq!(rooms.len(), building.rooms.len());
        assert_eq!(tour.way.first(), tour.way.last());
        assert!(tour.room_m.len() == tour.way.len() && tour.room_m.iter().all(|room_m| *room_m > 0.019));
        for point in &tour.way {
            assert!(floor.clearance_m(floor.cell_of(point).unwrap()) >= 0.35 + 0.02);
        }
        assert!(tour.way.windows(2).all(|pair| (pair[1] - pair[0]).norm() < 0.12));
        assert!(tour.length_m > 10.0, "{}", tour.length_m);
        assert_eq!(Tour::plan(&floor, &building, 9.0, &start), None, "a robot of 18 m fits nowhere");
    }
}
