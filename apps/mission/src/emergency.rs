//! What a low battery makes an aircraft do, whatever it was told.

use planner::Battery;

/// The way back is reckoned longer by this share: bends, wind.
pub(crate) const RETURN_ROOM: f64 = 1.3;

/// Why it goes back or down whatever it was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emergency {
    /// The battery has just enough for the way back: it returns and lands.
    Returning,
    /// Not even for that, or nobody knows the way: it lands here.
    LandingHere,
}

impl Emergency {
    /// For people.
    pub fn reason(self) -> &'static str {
        match self {
            Emergency::Returning => "the battery is low, so it went back to where it started",
            Emergency::LandingHere => "the battery is low and the way back too long, so it landed where it was",
        }
    }
}

impl Emergency {
    /// What is due now: `present` goes on while it can. `way_home_m` is the way back from here, if anybody knows one.
    pub(crate) fn due(
        present: Option<Emergency>,
        battery: &Battery,
        charge: f64,
        way_home_m: Option<f64>,
    ) -> Option<Emergency> {
        let left_s = battery.left_s(charge);
        let back_s = way_home_m.map(|way_m| battery.return_s(RETURN_ROOM * way_m));
        match (present, back_s) {
            (Some(Emergency::LandingHere), _) => present,
            // What is flown on the way back may be the reserve, down to the landing.
            (Some(Emergency::Returning), Some(_)) if charge * battery.endurance_s > battery.landing_s => present,
            (None, Some(back_s)) if left_s > back_s => None,
            (None, None) if left_s > battery.landing_s => None,
            (None, Some(_)) if left_s >= battery.landing_s => Some(Emergency::Returning),
            _ => Some(Emergency::LandingHere),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn back_while_it_reaches_else_down() {
        let battery = Battery { endurance_s: 100.0, reserve: 0.1, cruise_mps: 1.0, landing_s: 5.0 };
        let due = |present, charge, way_m| Emergency::due(present, &battery, charge, way_m);
        // 10 m back take 13 s and 5 s for the landing; the reserve is 10 s.
        assert_eq!(due(None, 0.29, Some(10.0)), None);
        assert_eq!(due(None, 0.27, Some(10.0)), Some(Emergency::Returning));
        assert_eq!(due(Some(Emergency::Returning), 0.12, Some(6.0)), Some(Emergency::Returning));
        assert_eq!(due(Some(Emergency::Returning), 0.05, Some(1.0)), Some(Emergency::LandingHere));
        assert_eq!(due(Some(Emergency::Returning), 0.2, None), Some(Emergency::LandingHere), "the way back is closed");
        assert_eq!(due(None, 0.12, Some(10.0)), Some(Emergency::LandingHere));
        assert_eq!((due(None, 0.2, None), due(None, 0.14, None)), (None, Some(Emergency::LandingHere)));
        assert_eq!(due(Some(Emergency::LandingHere), 1.0, Some(0.0)), Some(Emergency::LandingHere));
    }
}
