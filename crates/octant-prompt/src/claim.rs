//! What a description may say about a thing, and how it says it.

/// A claim about a thing; the numbers are indices of other things in the scene.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Claim {
    Color(&'static str),
    Material(String),
    /// What it is for: "sitting at a desk".
    Function(String),
    /// In the functional group round this thing.
    InGroup(usize),
    On(usize),
    In(usize),
    Under(usize),
    LeftOf(usize),
    RightOf(usize),
    InFrontOf(usize),
    Behind(usize),
    Between(usize, usize),
    /// The n-th (from 1) in an order of all things of its class.
    Nth(u32, Order),
}

/// An order of things.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Order {
    ClosestTo(usize),
    FarthestFrom(usize),
    Largest,
    Smallest,
    Highest,
    Lowest,
    FromLeft,
    FromRight,
}

/// Some things of a class, set apart before one of them is described: "of the 5 chairs closest to the door, ...".
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// How many there are.
    pub count: u32,
    /// What sets them apart: an order, whose first `count` they are (then the claim is [`Claim::Nth`] of 1), or what holds of
    /// exactly these.
    pub by: Claim,
}

impl Claim {
    /// Left, right, in front and behind are those of somebody in the middle of the room, who looks at the anchor or over the things he
    /// counts.
    pub fn is_view_dependent(&self) -> bool {
        let by_order = |order: &Order| matches!(order, Order::FromLeft | Order::FromRight);
        matches!(self, Claim::LeftOf(_) | Claim::RightOf(_) | Claim::InFrontOf(_) | Claim::Behind(_))
            || matches!(self, Claim::Nth(_, order) if by_order(order))
    }

    /// Counted among all of the class, beyond the first.
    pub fn is_ordinal(&self) -> bool {
        matches!(self, Claim::Nth(n, _) if *n > 1)
    }

    /// The other things it is about.
    pub fn anchors(&self) -> Vec<usize> {
        match *self {
            Claim::On(a) | Claim::In(a) | Claim::Under(a) | Claim::LeftOf(a) | Claim::RightOf(a) => vec![a],
            Claim::InFrontOf(a) | Claim::Behind(a) | Claim::InGroup(a) => vec![a],
            Claim::Nth(_, Order::ClosestTo(a) | Order::FarthestFrom(a)) => vec![a],
            Claim::Between(a, b) => vec![a, b],
            Claim::Nth(..) | Claim::Color(_) | Claim::Material(_) | Claim::Function(_) => Vec::new(),
        }
    }

    /// The same claim about other indices; None if one has no counterpart.
    pub fn with_anchors(&self, counterpart: &dyn Fn(usize) -> Option<usize>) -> Option<Claim> {
        Some(match self {
            Claim::InGroup(a) => Claim::InGroup(counterpart(*a)?),
            Claim::On(a) => Claim::On(counterpart(*a)?),
            Claim::In(a) => Claim::In(counterpart(*a)?),
            Claim::Under(a) => Claim::Under(counterpart(*a)?),
            Claim::LeftOf(a) => Claim::LeftOf(counterpart(*a)?),
            Claim::RightOf(a) => Claim::RightOf(counterpart(*a)?),
            Claim::InFrontOf(a) => Claim::InFrontOf(counterpart(*a)?),
            Claim::Behind(a) => Claim::Behind(counterpart(*a)?),
            Claim::Between(a, b) => Claim::Between(counterpart(*a)?, counterpart(*b)?),
            Claim::Nth(n, Order::ClosestTo(a)) => Claim::Nth(*n, Order::ClosestTo(counterpart(*a)?)),
            Claim::Nth(n, Order::FarthestFrom(a)) => Claim::Nth(*n, Order::FarthestFrom(counterpart(*a)?)),
            Claim::Nth(..) | Claim::Color(_) | Claim::Material(_) | Claim::Function(_) => self.clone(),
        })
    }

    /// What the claim puts before the noun and after it; `name` says what another thing is called.
    fn around(&self, name: &dyn Fn(usize) -> String) -> (String, String) {
        let before = |words: &str| (words.to_string(), String::new());
        let after = |words: String| (String::new(), words);
        match self {
            Claim::Color(word) => before(word),
            Claim::Material(word) => before(if word == "wood" { "wooden" } else { word }),
            Claim::Function(phrase) => after(format!("used for {phrase}")),
            Claim::InGroup(a) => {
                let support = name(*a);
                // A support that needs more words than its own noun comes last: "in the group of the desk closest to the door".
                let is_plain = !support.contains(" the ");
                after(if is_plain {
                    format!("in the {support} group")
                } else {
                    format!("in the group of the {support}")
                })
            }
            Claim::On(a) => after(format!("on the {}", name(*a))),
            Claim::In(a) => after(format!("in the {}", name(*a))),
            Claim::Under(a) => after(format!("under the {}", name(*a))),
            Claim::LeftOf(a) => after(format!("left of the {}", name(*a))),
            Claim::RightOf(a) => after(format!("right of the {}", name(*a))),
            Claim::InFrontOf(a) => after(format!("in front of the {}", name(*a))),
            Claim::Behind(a) => after(format!("behind the {}", name(*a))),
            Claim::Between(a, b) => after(format!("between the {} and the {}", name(*a), name(*b))),
            Claim::Nth(1, Order::ClosestTo(a)) => after(format!("closest to the {}", name(*a))),
            Claim::Nth(1, Order::FarthestFrom(a)) => after(format!("farthest from the {}", name(*a))),
            Claim::Nth(n, Order::ClosestTo(a)) => (format!("{} closest", ordinal(*n)), format!("to the {}", name(*a))),
            Claim::Nth(n, Order::FarthestFrom(a)) => {
                (format!("{} farthest", ordinal(*n)), format!("from the {}", name(*a)))
            }
            Claim::Nth(1, Order::FromLeft) => before("leftmost"),
            Claim::Nth(1, Order::FromRight) => before("rightmost"),
            Claim::Nth(n, Order::FromLeft) => (ordinal(*n), "from the left".into()),
            Claim::Nth(n, Order::FromRight) => (ordinal(*n), "from the right".into()),
            Claim::Nth(n, order) => {
                let word = match order {
                    Order::Largest => "largest",
                    Order::Smallest => "smallest",
                    Order::Highest => "highest",
                    _ => "lowest",
                };
                before(&if *n == 1 { word.to_string() } else { format!("{} {word}", ordinal(*n)) })
            }
        }
    }
}

/// `red chair left of the desk and closest to the door`: a noun with claims around it, without an article.
pub fn noun_phrase(noun: &str, claims: &[Claim], name: &dyn Fn(usize) -> String) -> String {
    // What a thing is for is said last: a purpose may hold any words.
    let (last, first): (Vec<&Claim>, Vec<&Claim>) =
        claims.iter().partition(|claim| matches!(claim, Claim::Function(_)));
    let parts: Vec<(String, String)> = first.into_iter().chain(last).map(|claim| claim.around(name)).collect();
    let mut words: Vec<&str> =
        parts.iter().map(|(before, _)| before.as_str()).filter(|part| !part.is_empty()).collect();
    words.push(noun);
    for (position, (_, after)) in parts.iter().filter(|(_, after)| !after.is_empty()).enumerate() {
        if position > 0 {
            words.push("and");
        }
        words.push(after);
    }
    words.join(" ")
}

/// `second`, `21st`.
fn ordinal(n: u32) -> String {
    const WORDS: [&str; 12] = [
        "first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh",
        "twelfth",
    ];
    if let Some(word) = WORDS.get((n as usize).wrapping_sub(1)) {
        return (*word).to_string();
    }
    let ending = match (n % 100, n % 10) {
        (11..=13, _) => "th",
        (_, 1) => "st",
        (_, 2) => "nd",
        (_, 3) => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phrases_by_hand() {
        let name = |index: usize| ["desk", "door"][index].to_string();
        let phrase = |claims: &[Claim]| noun_phrase("chair", claims, &name);
        assert_eq!(phrase(&[]), "chair");
        assert_eq!(phrase(&[Claim::Color("red"), Claim::LeftOf(0)]), "red chair left of the desk");
        assert_eq!(phrase(&[Claim::InGroup(0)]), "chair in the desk group");
        let of_described = |_: usize| "desk closest to the door".to_string();
        assert_eq!(
            noun_phrase("chair", &[Claim::InGroup(0)], &of_described),
            "chair in the group of the desk closest to the door"
        );
        let use_first = [Claim::Function("sitting at a desk".into()), Claim::On(1)];
        assert_eq!(phrase(&use_first), "chair on the door and used for sitting at a desk");
        let two = [Claim::On(0), Claim::Nth(1, Order::ClosestTo(1))];
        assert_eq!(phrase(&two), "chair on the desk and closest to the door");
        assert_eq!(phrase(&[Claim::Nth(3, Order::FromLeft)]), "third chair from the left");
        assert_eq!(phrase(&[Claim::Nth(21, Order::FarthestFrom(1))]), "21st farthest chair from the door");
        assert_eq!(
            phrase(&[Claim::Nth(2, Order::Highest), Claim::Material("wood".into())]),
            "second highest wooden chair"
        );
    }
}
