//! OmniVLN Eq. 7 with a vision-language model: e_ij = 1 if VLM(I_t, Prompt(L_i, L_j)) > tau_vlm.
//!
//! ```text
//!  panorama --look--> newest picture                          graph --ask--> short, plausible, nearest first
//!                          |                                                  |
//!                          +---------------> a thread per question <----------+     at most `max_under_way`
//!                                            crop, JPEG, chat, parse
//!                                                     |
//!  update_relations <--score, settle-- memory <--listen-- a probability, or why there is none
//! ```
//! Asked is an OpenAI-compatible server, with the crop of [`crate::perspective_crop`] and the text of [`crate::relation_question`].
//!
//! Nobody waits for an answer. Until one comes, and whenever none comes, the score of
//! [`geometric_score`] stands, as it does without any model. The paper asks when an edge is made; a robot cannot stand still for
//! seconds at every edge, so what is known of the edge is remembered and put into the graph when it comes. An answer counts
//! as long as both things are what and where they were when the picture was chosen. There is no queue that could grow or go
//! stale: what waits is the graph itself, and whoever is nearest is chosen anew from the newest picture each time a place is free.
//!
//! Everything the server says is hostile until parsed: wait, size and number of answers are bounded, every failure is "no verdict", is counted
//! and told once, and a server that fails in a row is left alone for a time that doubles.
//!
//! Answers come when they come: a run with a model is not the same bytes twice. Without one this file does nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use dsg::{Aabb, EvidenceSource, Object, ObjectId, Op, Relation, RelationKind, SceneGraph, Verdict};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::{Isometry3, Point3};
use omni_perception::{Equirectangular, RgbImage, Stamp};
use thiserror::Error;

use crate::error::MissionError;
use crate::openai::{ChatConfig, ChatError, chat_about_picture};
use crate::perspective_crop::{Aim, CropError, aim, render};
use crate::relation_question::{AnswerError, SYSTEM_TEXT, answer_schema, can_be_asked, parse_answer, user_text};
use crate::relation_verifier::geometric_score;
pub use crate::vision_config::VisionConfig;

/// Why a question has no verdict.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum VisionError {
    /// The crop could not be made.
    #[error("there is no picture to show: {0}")]
    Crop(#[from] CropError),
    /// The server did not answer, or with something that is no answer of a chat.
    #[error("{0}")]
    Chat(#[from] ChatError),
    /// What the model said is no answer to the question.
    #[error("the vision model did not answer the question: {0}")]
    Answer(#[from] AnswerError),
    /// The thread that asked could not begin, or died.
    #[error("the thread that asks the vision model did not live")]
    Thread,
}

/// What became of the questions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct VisionCounts {
    /// Questions sent.
    pub asked: u64,
    /// Answers with a verdict.
    pub answered: u64,
    /// ... of which on the other side of the threshold than the geometric score.
    pub overruled: u64,
    /// No connection, or it broke.
    pub unreachable: u64,
    /// No answer within the deadline.
    pub late: u64,
    /// An HTTP error.
    pub refused: u64,
    /// Something else than an answer, or too much of it.
    pub unreadable: u64,
    /// No picture, or no thread.
    pub not_sent: u64,
}

impl VisionCounts {
    /// Questions without a verdict.
    pub fn no_verdict(&self) -> u64 {
        self.unreachable + self.late + self.refused + self.unreadable + self.not_sent
    }

    /// One sentence, if anything was asked.
    pub fn sentence(&self) -> Option<String> {
        (self.asked > 0).then(|| {
            format!(
                "vision model: {} questions about relations, {} verdicts ({} against geometry), {} without a verdict ({} unreachable, {} late, {} refused, {} unreadable, {} not sent)",
                self.asked,
                self.answered,
                self.overruled,
                self.no_verdict(),
                self.unreachable,
                self.late,
                self.refused,
                self.unreadable,
                self.not_sent
            )
        })
    }
}

/// The newest panorama and where it was taken.
#[derive(Debug)]
struct View {
    stamp: Stamp,
    picture: RgbImage,
    camera: Equirectangular,
    world_from_camera: Isometry3<f64>,
}

/// Subject, kind, object of a question. "Above" is asked as "under" from the other side: one fact, one answer.
type Question = (ObjectId, RelationKind, ObjectId);

fn question_of(subject: ObjectId, kind: RelationKind, object: ObjectId) -> Option<Question> {
    match kind {
        RelationKind::Above => Some((object, RelationKind::Under, subject)),
        kind => can_be_asked(kind).then_some((subject, kind, object)),
    }
}

/// What and where the two things were when the question was asked.
#[derive(Debug, Clone, PartialEq)]
struct Witness {
    labels: [String; 2],
    boxes: [Aabb; 2],
}

impl Witness {
    fn of(subject: &Object, object: &Object) -> Witness {
        Witness { labels: [subject.label.clone(), object.label.clone()], boxes: [subject.bounds, object.bounds] }
    }

    fn holds_for(&self, things: [&Object; 2], moved_m: f64) -> bool {
        let is_same = |k: usize| {
            let (then, now) = (&self.boxes[k], &things[k].bounds);
            let faces = (now.min - then.min).abs().sup(&(now.max - then.max).abs());
            self.labels[k] == things[k].label && faces.max() < moved_m
        };
        is_same(0) && is_same(1)
    }
}

/// What is known about one relation.
#[derive(Debug, Clone)]
struct Memory {
    witness: Witness,
    questions: u32,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    /// May be asked (again).
    Open,
    UnderWay,
    /// The model says so.
    Said(f64),
    /// The model answered nonsense: it would again, as long as the things stay as they are.
    Nothing,
}

struct UnderWay {
    /// `None` once the graph that it was about is gone.
    question: Option<Question>,
    geometric: f64,
    answer: Receiver<Result<f64, VisionError>>,
}

/// Asks about relations and remembers the answers.
pub struct VisionVerifier {
    config: VisionConfig,
    view: Option<Arc<View>>,
    memory: BTreeMap<Question, Memory>,
    under_way: Vec<UnderWay>,
    failures: u32,
    rest_until: Stamp,
    told: BTreeSet<String>,
    news: Vec<String>,
    /// What became of the questions so far.
    pub counts: VisionCounts,
}

/// A picture older than this does not show what the map shows now.
const PICTURE_AGE_NS: i64 = 3_000_000_000;

impl VisionVerifier {
    /// Nothing asked yet.
    ///
    /// # Errors
    /// See [`VisionConfig::validate`].
    pub fn new(config: VisionConfig) -> Result<VisionVerifier, MissionError> {
        config.validate()?;
        Ok(VisionVerifier {
            config,
            view: None,
            memory: BTreeMap::new(),
            under_way: Vec::new(),
            failures: 0,
            rest_until: Stamp(i64::MIN),
            told: BTreeSet::new(),
            news: Vec::new(),
            counts: VisionCounts::default(),
        })
    }

    /// A new panorama, taken at `world_from_camera`. It takes the place of the one before.
    pub fn look(
        &mut self,
        stamp: Stamp,
        picture: RgbImage,
        camera: Equirectangular,
        world_from_camera: Isometry3<f64>,
    ) {
        self.view = Some(Arc::new(View { stamp, picture, camera, world_from_camera }));
    }

    /// Eq. 7 for one relation: the model's word if there is one that still counts, else the geometric score.
    pub fn score(&self, subject: &Object, object: &Object, kind: RelationKind) -> f64 {
        self.said(subject, object, kind).unwrap_or_else(|| geometric_score(subject, object, kind))
    }

    fn said(&self, subject: &Object, object: &Object, kind: RelationKind) -> Option<f64> {
        let question = question_of(subject.id, kind, object.id)?;
        let memory = self.memory.get(&question)?;
        let State::Said(probability) = memory.state else { return None };
        let things = if question.0 == subject.id { [subject, object] } else { [object, subject] };
        memory.witness.holds_for(things, self.config.moved_m).then_some(probability)
    }

    /// Takes the answers that have come in, and returns the changes of the graph that they make: relations whose stored score is not
    /// what is known now. (`dsg::update_relations` asks once about each relation and keeps that score; answers come later.)
    /// Answers that no longer count are taken back.
    pub fn settle(&mut self, graph: &SceneGraph, threshold: f64, now: Stamp) -> Vec<Op> {
        self.listen(threshold, now);
        self.memory
            .retain(|(subject, _, object), _| graph.object(*subject).is_some() && graph.object(*object).is_some());
        let mut ops = Vec::new();
        for (relation, things) in verified(graph) {
            let is_said = question_of(relation.subject, relation.kind, relation.object)
                .and_then(|question| self.memory.get(&question))
                .is_some_and(|memory| matches!(memory.state, State::Said(_)));
            if !is_said {
                continue;
            }
            let score = self.score(things[0], things[1], relation.kind);
            if score != relation.evidence.score {
                let mut news = *relation;
                news.evidence.score = score;
                news.evidence.verdict = if score > threshold { Verdict::Holds } else { Verdict::Rejected };
                ops.push(Op::PutRelation(news));
            }
        }
        let moved_m = self.config.moved_m;
        for ((subject, _, object), memory) in &mut self.memory {
            let (Some(subject), Some(object)) = (graph.object(*subject), graph.object(*object)) else { continue };
            let is_settled = matches!(memory.state, State::Said(_) | State::Nothing);
            if is_settled && !memory.witness.holds_for([subject, object], moved_m) {
                memory.state = State::Open;
            }
        }
        ops
    }

    /// Begins questions where places are free: about relations that geometry finds short and plausible, whose things the newest picture
    /// shows whole and large enough, the nearest to the camera first, what was asked before after what was not. `is_visible` says
    /// whether the map hides a box from the eye.
    pub fn ask(&mut self, graph: &SceneGraph, now: Stamp, is_visible: &dyn Fn(&Point3<f64>, &Aabb) -> bool) {
        let Some(view) = self.view.clone() else { return };
        let is_resting = now < self.rest_until;
        if is_resting || self.under_way.len() >= self.config.max_under_way || now.0 - view.stamp.0 > PICTURE_AGE_NS {
            return;
        }
        let eye = Point3::from(view.world_from_camera.translation.vector);
        let mut candidates: Vec<(u32, f64, Question)> = Vec::new();
        for (relation, [subject, object]) in verified(graph) {
            let Some(question) = question_of(relation.subject, relation.kind, relation.object) else { continue };
            let questions = match self.memory.get(&question) {
                Some(memory) if memory.state != State::Open => continue,
                Some(memory) => memory.questions,
                None => 0,
            };
            if questions >= self.config.max_questions
                || geometric_score(subject, object, relation.kind) < self.config.plausible_score
            {
                continue;
            }
            let distance_m = (nalgebra::center(&subject.bounds.center(), &object.bounds.center()) - eye).norm();
            candidates.push((questions, distance_m, question));
        }
        candidates.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        candidates.dedup_by_key(|candidate| candidate.2); // the two sides of "above" lie beside each other
        for (_, _, question) in candidates {
            if self.under_way.len() >= self.config.max_under_way {
                return;
            }
            let (Some(subject), Some(object)) = (graph.object(question.0), graph.object(question.2)) else { continue };
            let Some(aim) = self.shows(&view, &eye, [subject, object], is_visible) else { continue };
            self.begin(question, [subject, object], &view, aim);
        }
    }

    /// Where to look, if the picture shows both things.
    fn shows(
        &self,
        view: &View,
        eye: &Point3<f64>,
        things: [&Object; 2],
        is_visible: &dyn Fn(&Point3<f64>, &Aabb) -> bool,
    ) -> Option<Aim> {
        let column_rad = std::f64::consts::TAU / f64::from(view.picture.width.max(1));
        let camera_from_world = view.world_from_camera.inverse();
        let is_shown = |thing: &Object| {
            let middle = thing.bounds.center();
            let size_px = thing.bounds.diagonal_m() / ((middle - eye).norm() * column_rad);
            size_px >= self.config.min_size_px
                && view.camera.project(&(camera_from_world * middle)).is_some()
                && is_visible(eye, &thing.bounds)
        };
        if !things.into_iter().all(is_shown) {
            return None;
        }
        aim(eye, things.map(|thing| &thing.bounds), &self.config.crop).ok().filter(|aim| aim.is_whole)
    }

    fn begin(&mut self, question: Question, things: [&Object; 2], view: &Arc<View>, aim: Aim) {
        let text = user_text(question.1, things.map(|thing| thing.label.as_str()), &aim);
        let (chat, view) = (self.config.chat.clone(), Arc::clone(view));
        let (sender, answer) = channel();
        // A thread that cannot begin drops its sender, and `listen` counts it with those that died.
        let _ = std::thread::Builder::new().name("vision-question".into()).spawn(move || {
            // The mission may be over; then nobody wants the answer.
            let _ = sender.send(answer_of(&chat, &view, &aim, &text));
        });
        self.counts.asked += 1;
        let witness = Witness::of(things[0], things[1]);
        let questions = self.memory.get(&question).map_or(0, |memory| memory.questions) + 1;
        self.memory.insert(question, Memory { witness, questions, state: State::UnderWay });
        let geometric = geometric_score(things[0], things[1], question.1);
        self.under_way.push(UnderWay { question: Some(question), geometric, answer });
    }

    /// Takes what has come in; what has not is left under way.
    fn listen(&mut self, threshold: f64, now: Stamp) {
        for asked in std::mem::take(&mut self.under_way) {
            let answer = match asked.answer.try_recv() {
                Ok(answer) => answer,
                Err(TryRecvError::Empty) => {
                    self.under_way.push(asked);
                    continue;
                }
                Err(TryRecvError::Disconnected) => Err(VisionError::Thread),
            };
            let state = match answer {
                Ok(probability) => {
                    self.failures = 0;
                    self.counts.answered += 1;
                    if let Some((subject, kind, object)) = asked.question
                        && (probability > threshold) != (asked.geometric > threshold)
                    {
                        self.counts.overruled += 1;
                        self.news.push(format!(
                            "the vision model sees that {subject} {kind} {object} with probability {probability:.2}, geometry said {:.2}",
                            asked.geometric
                        ));
                    }
                    State::Said(probability)
                }
                Err(error) => self.failed(&error, now),
            };
            if let Some(memory) = asked.question.and_then(|question| self.memory.get_mut(&question)) {
                memory.state = state;
            }
        }
    }

    /// Counts a failure, tells it if it is the first of its sentence, and lets the server rest.
    fn failed(&mut self, error: &VisionError, now: Stamp) -> State {
        let (count, state) = match error {
            VisionError::Chat(ChatError::Address(_) | ChatError::Unreachable { .. }) => {
                (&mut self.counts.unreachable, State::Open)
            }
            VisionError::Chat(ChatError::Timeout(_)) => (&mut self.counts.late, State::Open),
            VisionError::Chat(ChatError::Status { .. }) => (&mut self.counts.refused, State::Open),
            VisionError::Chat(ChatError::Unreadable(_)) | VisionError::Answer(_) => {
                (&mut self.counts.unreadable, State::Nothing)
            }
            VisionError::Crop(_) | VisionError::Thread => (&mut self.counts.not_sent, State::Open),
        };
        *count += 1;
        // What a server writes into its errors may differ each time: its first words are told, a few of them.
        const MAX_TOLD: usize = 16;
        let sentence = error.to_string();
        if self.told.len() < MAX_TOLD && self.told.insert(sentence.clone()) {
            self.news.push(format!("{sentence}; the relation keeps its geometric score"));
        }
        self.failures = self.failures.saturating_add(1);
        if let Some(doublings) = self.failures.checked_sub(self.config.patience.max(1)) {
            let rest_s = 2.0_f64.powi(doublings.min(30) as i32).min(self.config.longest_rest_s);
            self.rest_until = now.plus_ns((rest_s * 1e9) as i64);
        }
        state
    }

    /// Sentences for the journal since this was asked last.
    pub fn take_news(&mut self) -> Vec<String> {
        std::mem::take(&mut self.news)
    }

    /// Questions under way.
    pub fn under_way(&self) -> usize {
        self.under_way.len()
    }

    /// The graph was replaced by another: its ids mean other things. What is under way still takes its place until it ends.
    pub fn forget_graph(&mut self) {
        self.memory.clear();
        self.view = None;
        self.under_way.iter_mut().for_each(|asked| asked.question = None);
    }
}

/// Relations that Eq. 7 is about, with their two things: short, not blocked, not stated by somebody.
fn verified(graph: &SceneGraph) -> impl Iterator<Item = (&Relation, [&Object; 2])> {
    graph.relations().chain(graph.dropped_relations()).filter_map(|relation| {
        let things = [graph.object(relation.subject)?, graph.object(relation.object)?];
        (relation.evidence.source == EvidenceSource::Verifier).then_some((relation, things))
    })
}

/// In a thread of its own: crop, ask, read.
fn answer_of(chat: &ChatConfig, view: &View, aim: &Aim, text: &str) -> Result<f64, VisionError> {
    const JPEG_QUALITY: u8 = 90;
    let crop = render(&view.picture, &view.camera, &view.world_from_camera, aim)?;
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)
        .encode(&crop.rgb, crop.width, crop.height, ExtendedColorType::Rgb8)
        .map_err(|_| CropError::Picture { width: crop.width, height: crop.height, bytes: crop.rgb.len() })?;
    let reply = chat_about_picture(chat, SYSTEM_TEXT, text, &jpeg, ("verdict", &answer_schema()))?;
    Ok(parse_answer(&reply.text)?)
}
