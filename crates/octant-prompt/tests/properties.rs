//! Laws of the prompt, the parsers and the critic.

mod support;

use dsg::{ObjectId, PlaceId, RoomId};
use nalgebra::{Isometry3, Point3, Vector3};
use octant_prompt::names::class_token;
use octant_prompt::vocabulary::{Class, functional_group};
use octant_prompt::{
    Action, Bearing, Critic, Estimate, Named, Octant, Prompt, PromptConfig, Prompter, ReasonerError, ScriptedReasoner,
    Situation, SymbolicReasoner, Target, TokenCounter, build_prompt, decide_with_critic, octant_of, parse_instruction,
    parse_reply, point_in_body,
};
use proptest::prelude::*;
use support::{decode, graph, objects, pose};

fn instruction() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => prop::sample::select(vec!["find the mug near the sink", "go to the chair", "go to the kitchen, then find the box", "find the unicorn"]).prop_map(str::to_string),
        1 => "\\PC{0,400}",
        1 => "([a-z]{1,9} ){0,300}",
        1 => "[0-9]{0,600}",
    ]
}

mod octants {
    use super::*;

    proptest! {
        #[test]
        fn a_point_has_exactly_one_octant(x in -9.0..9.0f64, y in -9.0..9.0f64, z in -3.0..3.0f64, h in 0.0..1.5f64) {
            let octant = octant_of(&Point3::new(x, y, z), h);
            prop_assert_eq!(octant.signs(), (x >= 0.0, y >= 0.0, z - h >= 0.0));
            prop_assert_eq!(Octant::ALL.iter().filter(|other| **other == octant).count(), 1);
        }

        #[test]
        fn a_quarter_turn_permutes_the_octants(x in -9.0..9.0f64, y in -9.0..9.0f64, z in -3.0..3.0f64, yaw in -3.2..3.2f64) {
            let point = Point3::new(x, y, z);
            let before = point_in_body(&Isometry3::new(Vector3::new(0.3, -0.7, 0.2), Vector3::z() * yaw), &point);
            // Rounding at an axis may go either way.
            prop_assume!(before.x.abs() > 1e-9 && before.y.abs() > 1e-9);
            let turned = Isometry3::new(Vector3::new(0.3, -0.7, 0.2), Vector3::z() * (yaw + std::f64::consts::FRAC_PI_2));
            let after = octant_of(&point_in_body(&turned, &point), 0.4);
            prop_assert_eq!(after, octant_of(&before, 0.4).after_left_turn());
        }

        #[test]
        fn bearing_and_octant_agree_about_sides(x in -9.0..9.0f64, y in -9.0..9.0f64) {
            let name = Bearing::of(&Point3::new(x, y, 0.0)).name();
            let octant = octant_of(&Point3::new(x, y, 0.0), 0.0).name();
            for word in name.split('-') {
                prop_assert!(octant.split('-').any(|part| part == word), "{name} {octant}");
            }
        }
    }

    #[test]
    fn four_left_turns_are_none() {
        for octant in Octant::ALL {
            assert_eq!(octant.after_left_turn().after_left_turn().after_left_turn().after_left_turn(), octant);
        }
    }
}

mod prompts {
    use super::*;

    fn checked(prompt: &Prompt, counter: &dyn TokenCounter, budget: usize) -> Result<(), TestCaseError> {
        prop_assert_eq!(prompt.tokens, counter.count(&prompt.text));
        prop_assert!(prompt.tokens <= budget, "{} > {budget}:\n{}", prompt.tokens, prompt.text);
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn the_budget_is_never_exceeded(rooms in 1usize..12, things in objects(6, 120), text in instruction(), budget in 150usize..900, yaw in -3.2..3.2f64) {
            let graph = graph(rooms, &["kitchen", "", "a \"very; long\" name of a room, indeed"], &things);
            let config = PromptConfig { budget_tokens: budget, ..PromptConfig::default() };
            checked(&build_prompt(&graph, &pose(2.5, 2.5, yaw), &text, &config, &Estimate), &Estimate, budget)?;
            // A counter with no idea of words, and not additive over lines.
            let bytes = |text: &str| text.len().div_ceil(4);
            checked(&build_prompt(&graph, &pose(2.5, 2.5, yaw), &text, &config, &bytes), &bytes, budget)?;
        }

        #[test]
        fn a_prompt_decodes_back(rooms in 1usize..7, things in objects(4, 40), yaw in -3.2..3.2f64) {
            let graph = graph(rooms, &["kitchen", "meeting room"], &things);
            let world_from_body = pose(2.5, 2.5, yaw);
            let config = PromptConfig { budget_tokens: 100_000, ..PromptConfig::default() };
            let prompt = build_prompt(&graph, &world_from_body, "find the mug", &config, &Estimate);
            let decoded = decode(&prompt.text);
            prop_assert_eq!((decoded.hidden_objects, decoded.hidden_rooms), (0, 0));

            let object = |name: &str| match prompt.names.get(name) {
                Some(Named::Object(id)) => graph.object(id).expect("named objects exist"),
                other => panic!("{name} is {other:?}\n{}", prompt.text),
            };
            let mut seen: Vec<ObjectId> = Vec::new();
            for (name, (octant, distance)) in &decoded.focal {
                let object = object(name);
                let at = point_in_body(&world_from_body, &object.centroid);
                prop_assert_eq!(octant.parse::<Octant>().expect("octant"), octant_of(&at, config.camera_height_m));
                prop_assert_eq!(distance, &format!("{:.1}", at.coords.norm()));
                prop_assert!(at.coords.norm() <= config.focal_radius_m);
                seen.push(object.id);
            }
            for (name, (octant, group, distance)) in &decoded.peripheral {
                let object = object(name);
                let at = point_in_body(&world_from_body, &object.centroid);
                prop_assert_eq!(octant.parse::<Octant>().expect("octant"), octant_of(&at, config.camera_height_m));
                prop_assert_eq!(group, functional_group(&Class::new(&object.label)));
                prop_assert_eq!(distance, &format!("{:.1}", at.coords.norm()));
                seen.push(object.id);
            }
            for (room, (_, groups)) in &decoded.rooms {
                let id = match prompt.names.get(room) { Some(Named::Room(id)) => Some(id), _ => None };
                for (group, class, count) in groups {
                    let mut last_m = 0.0;
                    for ordinal in 1..=*count {
                        let object = object(&format!("{room}.{class}{ordinal}"));
                        prop_assert_eq!(object.room, id);
                        prop_assert_eq!(&class_token(&object.label), class);
                        // Two labels may share a word ("a b" and "a_b"); then the group is that of one of them.
                        let alike = graph.objects().filter(|other| class_token(&other.label) == *class);
                        prop_assert!(alike.into_iter().any(|other| functional_group(&Class::new(&other.label)) == group));
                        let distance_m = point_in_body(&world_from_body, &object.centroid).coords.norm();
                        prop_assert!(distance_m >= last_m, "class1 is the nearest");
                        last_m = distance_m;
                        seen.push(object.id);
                    }
                }
            }
            // The rest of a full room: ordinals go on where the list ends.
            for (class, count) in &decoded.crowd {
                let names = || decoded.focal.keys().chain(decoded.peripheral.keys());
                let listed = names().filter(|name| octant_prompt::names::split_ordinal(name).is_some_and(|(stem, _)| stem == class)).count();
                seen.extend((listed + 1..=listed + count).map(|ordinal| object(&format!("{class}{ordinal}")).id));
            }
            prop_assert!(decoded.areas.is_empty());
            seen.sort();
            seen.dedup();
            // One class word may stand in two groups of a room when labels collide; else every object is recovered.
            let all: Vec<ObjectId> = graph.objects().map(|object| object.id).collect();
            prop_assert_eq!(seen, all, "\n{}", prompt.text);
        }

        #[test]
        fn far_rooms_are_counted_by_direction_and_distance(rooms in 20usize..90, things in objects(90, 200), yaw in -3.2..3.2f64) {
            let graph = graph(rooms, &[], &things);
            let world_from_body = pose(2.5, 2.5, yaw);
            let config = PromptConfig { budget_tokens: 100_000, ..PromptConfig::default() };
            let prompt = build_prompt(&graph, &world_from_body, "find the mug", &config, &Estimate);
            let decoded = decode(&prompt.text);
            prop_assert_eq!((decoded.hidden_objects, decoded.hidden_rooms), (0, 0));
            let lined = decoded.rooms.keys().filter(|name| *name != "outside").count();
            prop_assert_eq!(lined + decoded.areas.iter().map(|area| area.rooms).sum::<usize>() + 1, rooms);
            // Every room without a line lies in exactly one area, by its side and distance.
            let far: Vec<&dsg::Room> = graph.rooms().filter(|room| room.id != RoomId(0) && !decoded.rooms.contains_key(&format!("room{}", room.id.0))).collect();
            for area in &decoded.areas {
                let (low, high) = area.span_m;
                let members: Vec<&dsg::Room> = far.iter().copied().filter(|room| {
                    let at = point_in_body(&world_from_body, &room.center);
                    let side = if at.x.abs() >= at.y.abs() { if at.x >= 0.0 { "front" } else { "back" } } else if at.y >= 0.0 { "left" } else { "right" };
                    side == area.side && (low..=high).contains(&at.coords.norm().round())
                }).collect();
                // Two areas of one side may share a whole metre at their border.
                prop_assert!(members.len() >= area.rooms);
                for (class, room, distance_m) in &area.first {
                    let room = members.iter().find(|member| format!("room{}", member.id.0) == *room).expect("one of the area");
                    prop_assert_eq!(point_in_body(&world_from_body, &room.center).coords.norm().round(), *distance_m);
                    prop_assert_eq!(prompt.names.get(&format!("room{}", room.id.0)), Some(Named::Room(room.id)));
                    prop_assert!(graph.objects().any(|object| object.room == Some(room.id) && class_token(&object.label) == *class));
                }
            }
            let mut counted: std::collections::BTreeMap<&str, usize> = std::collections::BTreeMap::new();
            for (class, count) in decoded.areas.iter().flat_map(|area| &area.counts) {
                *counted.entry(class).or_default() += count;
            }
            let mut expected: std::collections::BTreeMap<String, usize> = std::collections::BTreeMap::new();
            for object in graph.objects().filter(|object| far.iter().any(|room| object.room == Some(room.id))) {
                *expected.entry(class_token(&object.label)).or_default() += 1;
            }
            let counted: std::collections::BTreeMap<String, usize> = counted.into_iter().map(|(class, count)| (class.to_string(), count)).collect();
            prop_assert_eq!(counted, expected, "\n{}", prompt.text);
        }

        #[test]
        fn a_change_of_pose_costs_no_second_look_and_changes_nothing(
            rooms in 1usize..40, things in objects(44, 120), text in instruction(), budget in 150usize..900,
            poses in prop::collection::vec((-3.0..13.0f64, -3.0..90.0f64, -3.2..3.2f64), 1..5),
        ) {
            // Some things lie in no room, and so do some poses.
            let graph = graph(rooms, &["kitchen", "", "office"], &things);
            let prompter = Prompter::new(&graph, &text);
            let config = PromptConfig { budget_tokens: budget, ..PromptConfig::default() };
            for (x, y, yaw) in poses {
                let pose = pose(x, y, yaw);
                prop_assert_eq!(prompter.prompt(&pose, &config, &Estimate), build_prompt(&graph, &pose, &text, &config, &Estimate));
            }
        }

        #[test]
        fn the_targets_room_is_reached_in_two_prompts_from_any_size(rooms in 1usize..400, things in objects(400, 250), mug in 0usize..400, yaw in -3.2..3.2f64) {
            let mut things: Vec<support::Put> = things.into_iter().filter(|thing| thing.label != "mug").collect();
            let (x, y) = support::corner(mug % rooms);
            things.push(support::put("mug", x + 2.0, y + 2.0, 0.8));
            let graph = graph(rooms, &[], &things);
            let target = graph.objects().find(|object| object.label == "mug").expect("it was put");
            for budget in [150, 600] {
                let config = PromptConfig { budget_tokens: budget, ..PromptConfig::default() };
                let prompt = |world_from_body: &Isometry3<f64>| build_prompt(&graph, world_from_body, "find the mug", &config, &Estimate);
                let first = prompt(&pose(2.5, 2.5, yaw));
                if first.names.name_of(Named::Object(target.id)).is_some() {
                    continue; // already in the first
                }
                let decoded = decode(&first.text);
                let named: Vec<&(String, String, f64)> = decoded.areas.iter().flat_map(|area| &area.first).chain(&decoded.hidden_first).filter(|(class, ..)| class == "mug").collect();
                prop_assert_eq!(named.len(), 1, "at {} tokens:\n{}", budget, first.text);
                let Some(Named::Room(room)) = first.names.get(&named[0].1) else { panic!("{} is a name", named[0].1) };
                prop_assert_eq!(Some(room), target.room);
                let center = graph.room(room).expect("it exists").center;
                let second = prompt(&pose(center.x, center.y, 0.0));
                prop_assert!(second.names.name_of(Named::Object(target.id)).is_some(), "at {} tokens:\n{}", budget, second.text);
            }
        }

        #[test]
        fn same_input_same_prompt(things in objects(4, 60), text in instruction()) {
            let graph = graph(4, &[], &things);
            let build = || build_prompt(&graph, &pose(2.5, 2.5, 0.3), &text, &PromptConfig::default(), &Estimate);
            prop_assert_eq!(build(), build());
        }
    }
}

mod parsers {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn any_text_is_an_instruction(text in "\\PC{0,300}") {
            let parsed = parse_instruction(&text);
            prop_assert_eq!(parse_instruction(&text), parsed);
        }

        #[test]
        fn any_words_of_the_grammar_are_an_instruction(words in prop::collection::vec(prop::sample::select(vec![
            "find", "go to", "the", "mug", "near", "with", "on", "top", "of", "it", "and", "between", "not", "in", "kitchen", "room", "one", "second",
            "from", "left", "facing", "when", "you", "enter", ",", ".", "then", "closest", "to", "large", "red", "that", "is", "chair", "upstairs", "3",
        ]), 0..40)) {
            let parsed = parse_instruction(&words.join(" "));
            for step in &parsed.steps {
                prop_assert!(!step.goal.class.text.is_empty() || step.goal.room.is_some());
            }
            let _ = parsed.nouns();
        }

        #[test]
        fn no_reply_panics_the_parser(text in prop_oneof!["\\PC{0,300}", "[{}\\[\\]\":,a-z_()\\\\]{0,200}", "(go_near|stop|\\{\"action\":)\\PC{0,60}"]) {
            let graph = graph(2, &[], &[support::put("mug", 2.0, 2.0, 0.5)]);
            let prompt = build_prompt(&graph, &pose(2.5, 2.5, 0.0), "find the mug", &PromptConfig::default(), &Estimate);
            let named = parse_reply(&text, &prompt.names).ok().and_then(|reply| reply.action.object());
            prop_assert!(named.is_none_or(|id| graph.object(id).is_some()));
        }

        #[test]
        fn no_arguments_panic_a_tool(name in prop::sample::select(vec!["find_on", "find_between", "order_by", "objects_in", "rooms_with", "path_length", "describe", "x"]), arguments in prop_oneof!["\\PC{0,100}", "\\{\"(id|a|class|room|key|k|view)\": ?(\"(mug1|O1|R0|room0|size|facing mug1)\"|-?[0-9]{1,4}|null|\\[\\])\\}"]) {
            let graph = graph(2, &[], &[support::put("mug", 2.0, 2.0, 0.5), support::put("table", 2.0, 2.2, 0.2)]);
            let prompt = build_prompt(&graph, &pose(2.5, 2.5, 0.0), "find the mug", &PromptConfig::default(), &Estimate);
            let instruction = parse_instruction("find the mug");
            let path = |_: &Point3<f64>| Some(1.0);
            let can_stop = |_: ObjectId| false;
            let situation = Situation::new(&graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop);
            let _ = octant_prompt::tools::call_text(name, &arguments, &octant_prompt::tools::ToolBox { situation: &situation, names: &prompt.names });
        }
    }
}

mod critic {
    use super::*;

    /// Any action about any id that may or may not exist.
    fn action_text() -> impl Strategy<Value = String> {
        let verb = prop::sample::select(vec!["go_to_room", "turn_to", "go_near", "explore", "stop", "give_up"]);
        let target = prop::sample::select(vec![
            "mug1",
            "room1.mug1",
            "mug2",
            "sink1",
            "room1.sink1",
            "table1",
            "room0",
            "room1",
            "room9",
            "frontier1",
            "view1",
            "front-left-top",
            "kitchen",
            "",
        ]);
        prop_oneof![4 => (verb, target).prop_map(|(verb, target)| format!("{verb}({target})")), 1 => "\\PC{0,60}"]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]

        #[test]
        fn nothing_unverified_gets_through(
            texts in prop::collection::vec(action_text(), 0..5), things in objects(2, 12), seed in 0u64..4,
            text in instruction(), reachable in any::<bool>(), near in any::<bool>(), has_frontier in any::<bool>(),
        ) {
            let mut things = things;
            things.extend([support::put("mug", 2.0, 2.0, 0.8), support::put("sink", 2.2, 2.4, 0.8), support::put("mug", 7.0, 2.0, 0.8)]);
            let graph = graph(2, &["kitchen"], &things);
            let instruction = parse_instruction(&text);
            prop_assume!(!instruction.steps.is_empty());
            let path = |point: &Point3<f64>| (reachable || point.x < 5.0).then_some((point.x - 2.5).abs() + (point.y - 2.5).abs());
            let can_stop = |id: ObjectId| near && id.0 % 4 == seed;
            let frontiers = if has_frontier { vec![PlaceId(12)] } else { vec![] };
            let unseen = [PlaceId(3)];
            let situation = Situation {
                frontiers: &frontiers, unseen: if has_frontier { &unseen } else { &[] },
                ..Situation::new(&graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop)
            };
            let prompt = octant_prompt::build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
            let critic = Critic::default();
            let record = decide_with_critic(&mut ScriptedReasoner::new(texts.clone()), &critic, &situation, &prompt, 3, &mut SymbolicReasoner::default());
            prop_assert!(record.attempts.len() <= 5);
            // The embedded reasoner's own action always passes its critic.
            let reply = record.reply.as_ref().expect("the fallback never fails");
            prop_assert_eq!(critic.check(&reply.action, &situation, prompt.revision), Ok(()));
            // And what passes holds by facts that the critic does not compute itself.
            match &reply.action {
                Action::Stop(Target::Object(id)) => {
                    prop_assert!(can_stop(*id), "stopped out of reach");
                }
                Action::GoNear(id) => prop_assert!(path(&graph.object(*id).expect("exists").centroid).is_some()),
                Action::GoToRoom(id) => prop_assert!(graph.room(*id).is_some()),
                Action::Explore(id) => prop_assert!(frontiers.contains(id) || unseen.contains(id)),
                Action::GiveUp { .. } => prop_assert!(frontiers.iter().all(|id| path(&graph.place(*id).expect("exists").position).is_none())),
                Action::Stop(Target::Room(id)) => prop_assert_eq!(*id, RoomId(0)),
                Action::TurnTo(_) => {}
            }
        }
    }

    #[test]
    fn a_script_that_ends_falls_back_at_once() {
        let graph = graph(1, &[], &[support::put("mug", 2.0, 2.0, 0.8)]);
        let instruction = parse_instruction("find the mug");
        let path = |_: &Point3<f64>| Some(1.0);
        let can_stop = |_: ObjectId| false;
        let situation = Situation::new(&graph, pose(2.5, 2.5, 0.0), &instruction, &path, &can_stop);
        let prompt = octant_prompt::build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
        let mut script = ScriptedReasoner::new(["stop(mug1)", "nonsense"]);
        let record = decide_with_critic(
            &mut script,
            &Critic::default(),
            &situation,
            &prompt,
            9,
            &mut SymbolicReasoner::default(),
        );
        assert!(record.is_fallback && record.decided_by == "symbolic");
        assert_eq!(record.reply.expect("symbolic").action, Action::GoNear(ObjectId(1)));
        assert_eq!(record.attempts.len(), 4); // refused, unparsable, script ended, symbolic
        assert_eq!(record.attempts[2].outcome, Err(ReasonerError::ScriptEnded));
    }
}

mod descriptions {
    use super::*;
    use octant_prompt::clause_truth::{Surroundings, singles_out};
    use octant_prompt::describe::{describe, describe_from_a_view, describe_without_a_view, is_understood, things_in};
    use octant_prompt::grounding::Scene;

    fn check(scene: &Scene) -> Result<(), TestCaseError> {
        for (index, thing) in scene.things.iter().enumerate() {
            let shortest = describe(scene, thing.id);
            let plain = describe_without_a_view(scene, thing.id);
            let seen = describe_from_a_view(scene, thing.id);
            prop_assert!(plain.iter().all(|found| !found.is_view_dependent));
            prop_assert!(seen.iter().all(|found| found.is_view_dependent));
            prop_assert_eq!(shortest.is_some(), plain.is_some() || seen.is_some());
            if let Some(shortest) = &shortest {
                // Of those that are as sure.
                let others = plain
                    .iter()
                    .chain(seen.iter().filter(|other| other.eye_error_m == shortest.eye_error_m))
                    .filter(|other| other.room == shortest.room && other.group.is_none() && shortest.group.is_none());
                prop_assert!(others.into_iter().all(|other| other.words() >= shortest.words()), "{}", shortest.text);
            }
            for found in [shortest, plain, seen].into_iter().flatten() {
                prop_assert!(is_understood(&found.text, scene, thing.id), "{}", found.text);
                let around = match &found.room {
                    None => Surroundings::whole(scene),
                    Some(room) => Surroundings::of(scene, things_in(scene, room)),
                };
                let around = Surroundings { eye_error_m: found.eye_error_m, ..around };
                let answers: Vec<usize> = (0..scene.things.len())
                    .filter(|other| scene.label(*other) == scene.label(index))
                    .filter(|other| singles_out(found.group.as_ref(), &found.claims, &around, *other))
                    .collect();
                prop_assert_eq!(answers, vec![index], "{}", found.text);
            }
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn a_description_is_true_of_one_thing_alone_and_understood(things in objects(1, 12)) {
            check(&Scene::from_graph(&graph(1, &[], &things), 0))?;
        }

        #[test]
        fn in_a_building_the_room_is_named_and_everything_else_is_said_within_it(things in objects(3, 14)) {
            check(&Scene::from_graph(&graph(3, &["kitchen", "bedroom", "office"], &things), 0))?;
        }
    }
}
