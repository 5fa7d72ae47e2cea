//! Parts of the method that an experiment leaves out, to see what each is worth.

use std::collections::BTreeSet;

/// One part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// Rooms: no partition, so no rooms in the graph (layer 4).
    Rooms,
    /// Pruning of relations by line of sight (Eq. 6): all that are proposed stay.
    Pruning,
    /// Verification of short relations (Eq. 7): all that are proposed are believed.
    Verify,
    /// Octants in the prompt (Eq. 8, 9): coordinates of the building stand in their stead.
    Octants,
    /// Tiers of the prompt: everything is described in full, however far, without a budget.
    Tiers,
    /// The reasoning's steps before the search: rooms and groups where a thing is usual, and what a way would show. The nearest frontier
    /// is next.
    Steps,
    /// The critic: whatever is proposed is done.
    Critic,
    /// The vote over frames (Eq. 4): a thing is what its newest view says.
    Vote,
}

impl Part {
    /// All of them.
    pub const ALL: [Part; 8] =
        [Part::Rooms, Part::Pruning, Part::Verify, Part::Octants, Part::Tiers, Part::Steps, Part::Critic, Part::Vote];

    /// The word on a command line.
    pub fn word(self) -> &'static str {
        match self {
            Part::Rooms => "rooms",
            Part::Pruning => "pruning",
            Part::Verify => "verify",
            Part::Octants => "octants",
            Part::Tiers => "tiers",
            Part::Steps => "steps",
            Part::Critic => "critic",
            Part::Vote => "vote",
        }
    }
}

/// What is left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Ablation(pub BTreeSet<Part>);

impl Ablation {
    /// Without one part.
    pub fn of(part: Part) -> Ablation {
        Ablation(BTreeSet::from([part]))
    }

    /// Whether the method has this part.
    pub fn keeps(&self, part: Part) -> bool {
        !self.0.contains(&part)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use octant_prompt::SymbolicReasoner;
    use omni_perception::{Equirectangular, Stamp};
    use robot_model::RobotModel;

    use super::*;
    use crate::config::MissionConfig;
    use crate::mission::{Mission, grounding};
    use crate::reasoning::Mind;

    #[test]
    fn what_is_left_out_reaches_critic_and_reasoner() {
        let robot = RobotModel::builtin_quadruped();
        let mission = |without: Ablation| {
            let mut config = MissionConfig::default();
            config.leave_out(without);
            let mind = Mind::Embedded(Box::new(SymbolicReasoner { grounding: grounding(&config) }));
            let begin = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
            Mission::new(&robot, "find the mug", config, Equirectangular::default(), mind, Stamp(0), &begin)
                .expect("a mission")
        };
        let whole = mission(Ablation::default());
        assert!(!whole.critic.is_blind && whole.critic.grounding.searches_by_steps);
        assert!(mission(Ablation::of(Part::Critic)).critic.is_blind);
        assert!(!mission(Ablation::of(Part::Steps)).critic.grounding.searches_by_steps);
    }
}
