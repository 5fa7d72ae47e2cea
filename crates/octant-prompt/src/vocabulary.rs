//! What words mean to the symbolic side: synonyms and look-alikes of classes, functional groups, room kinds with their usual contents,
//! colours and materials. Nothing here is required: a class that no table knows is still a class, equal to itself only.
//!
//! The tables are prior knowledge of ordinary flats and offices, written by hand; they steer the order of a search (OmniVLN,
//! "Functional Group Inference exploits object co-occurrence"), never the truth of a relation.

use std::collections::HashMap;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

/// A class as somebody wrote it, normalised: lower case, single spaces, singular.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Class {
    /// The words as normalised, for example `coffee mug`.
    pub text: String,
    /// The first word of the synonym group, for example `mug`; equal to `text` when no table knows it.
    pub canonical: String,
}

impl Class {
    /// Normalises `text`; empty text gives the empty class, which matches nothing.
    pub fn new(text: &str) -> Class {
        let text = singular_phrase(&normalise(text));
        let canonical = canonical(&text).unwrap_or(&text).to_string();
        Class { text, canonical }
    }

    /// True for words that stand for any object ("thing", "object", "one", "item").
    pub fn is_wildcard(&self) -> bool {
        matches!(
            self.text.as_str(),
            "thing" | "object" | "one" | "item" | "something" | "anything"
        )
    }

    /// The last word: `chair` of `office chair`.
    pub fn head(&self) -> &str {
        self.canonical.rsplit(' ').next().unwrap_or(&self.canonical)
    }
}

/// How well the class `label` answers to the asked class, in [0, 1].
///
/// 1 same words, 0.95 synonym, 0.8 a kind of it (`office chair` for `chair`), 0.7 the general word for a special one, 0.5 look-alike
/// (`cup` for `mug`), else 0. Look-alikes stay below [`crate::grounding::GroundingConfig::accept`] on purpose: they are worth a closer look after the
/// search, not a stop.
pub fn class_similarity(asked: &Class, label: &Class) -> f64 {
    if asked.is_wildcard() {
        return 0.6;
    }
    if asked.text.is_empty() || label.text.is_empty() {
        return 0.0;
    }
    if asked.text == label.text {
        return 1.0;
    }
    if asked.canonical == label.canonical {
        return 0.95;
    }
    if are_look_alikes(&asked.canonical, &label.canonical) {
        return 0.5;
    }
    let ends_with_word = |long: &str, short: &str| {
        long.len() > short.len()
            && long.ends_with(short)
            && long.as_bytes()[long.len() - short.len() - 1] == b' '
    };
    if ends_with_word(&label.text, &asked.text)
        || ends_with_word(&label.canonical, &asked.canonical)
    {
        return 0.8;
    }
    if ends_with_word(&asked.text, &label.text)
        || ends_with_word(&asked.canonical, &label.canonical)
    {
        return 0.7;
    }
    0.0
}

/// The usual functional group of a class, used to order prompt lines: `seating`, `work`, ... or `other`.
pub fn functional_group(class: &Class) -> &'static str {
    let of = |name: &str| GROUP_OF.get(name).copied();
    of(&class.canonical)
        .or_else(|| of(class.head()))
        .unwrap_or("other")
}

/// True when an object of this class is small enough to be seen only from within a few metres.
pub fn is_small(class: &Class) -> bool {
    !LARGE_OR_FIXED.contains(&class.canonical.as_str()) && !LARGE_OR_FIXED.contains(&class.head())
}

/// True when things are kept inside an object of this class, so that "on the shelf" may mean inside its box.
pub fn is_container(class: &Class) -> bool {
    let names = [
        "shelf",
        "bookshelf",
        "cabinet",
        "rack",
        "wardrobe",
        "sink",
        "box",
        "basket",
        "shoe rack",
        "bathtub",
        "cart",
        "kitchen cabinet",
        "trash can",
    ];
    names.contains(&class.canonical.as_str()) || names.contains(&class.head())
}

/// The room kind named by a phrase such as `conference room`, or None.
pub fn room_kind(phrase: &str) -> Option<&'static str> {
    ROOM_NAME_OF
        .get(singular_phrase(&normalise(phrase)).as_str())
        .copied()
}

/// How usual an object of `class` is in a room of `kind`, in [0.08, 1].
pub fn affinity(kind: &str, class: &Class) -> f64 {
    const UNUSUAL: f64 = 0.08; // never zero: a mug may stand anywhere
    let Some(room) = ROOMS.iter().find(|room| room.kind == kind) else {
        return UNUSUAL;
    };
    let position = room
        .contents
        .iter()
        .position(|name| *name == class.canonical)
        .or_else(|| room.contents.iter().position(|name| *name == class.head()));
    // The lists are written with the most telling things first.
    position.map_or(UNUSUAL, |index| {
        1.0 - 0.6 * index as f64 / room.contents.len() as f64
    })
}

/// Probability of each room kind given the distinct classes seen in a room, by naive Bayes with a flat prior; sorted by kind order of the
/// table. Empty contents give the flat prior.
pub fn kind_probabilities(contents: &[Class]) -> Vec<(&'static str, f64)> {
    let logs: Vec<f64> = ROOMS
        .iter()
        .map(|room| {
            contents
                .iter()
                .map(|class| affinity(room.kind, class).ln())
                .sum()
        })
        .collect();
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = logs.iter().map(|log| (log - top).exp()).sum();
    ROOMS
        .iter()
        .zip(logs)
        .map(|(room, log)| (room.kind, (log - top).exp() / total))
        .collect()
}

/// Room kinds whose names are used for one another ("office" and "study"), in [0, 1]; 1 for equal kinds.
pub fn kind_similarity(asked: &str, actual: &str) -> f64 {
    const ALIKE: &[(&str, &str)] = &[
        ("kitchen", "break room"),
        ("living room", "lobby"),
        ("dining room", "kitchen"),
        ("dining room", "living room"),
        ("office", "library"),
        ("storage", "laundry room"),
        ("corridor", "lobby"),
        ("bedroom", "nursery"),
        ("office", "lab"),
        ("storage", "print room"),
        ("bathroom", "laundry room"),
    ];
    if asked == actual {
        return 1.0;
    }
    if ALIKE
        .iter()
        .any(|&(a, b)| (a, b) == (asked, actual) || (b, a) == (asked, actual))
    {
        0.4
    } else {
        0.05
    }
}

/// Reference colour (sRGB, 0-255) of a colour word.
pub fn color_rgb(word: &str) -> Option<[f64; 3]> {
    COLORS
        .iter()
        .find(|(name, _)| *name == word)
        .map(|(_, rgb)| *rgb)
}

/// True for material words ("wooden", "metal", ...).
pub fn material(word: &str) -> Option<&'static str> {
    MATERIALS
        .iter()
        .find(|(name, _)| *name == word)
        .map(|(_, canonical)| *canonical)
}

/// The canonical name of a class phrase that the tables know (already normalised and singular).
pub fn canonical(phrase: &str) -> Option<&'static str> {
    CANONICAL_OF.get(phrase).copied()
}

/// Lower case, letters, digits and single spaces only (`-`, `_` and other marks become spaces; apostrophes vanish).
pub fn normalise(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_alphanumeric() {
            out.extend(c.to_lowercase());
        } else if !matches!(c, '\'' | '\u{2019}') && !out.is_empty() && !out.ends_with(' ') {
            out.push(' ');
        }
    }
    out.truncate(out.trim_end().len());
    out
}

/// Singular of the last word of a normalised phrase; irregular plurals by table, words such as `glass` and `stairs` untouched.
pub fn singular_phrase(phrase: &str) -> String {
    let (front, last) = phrase
        .rsplit_once(' ')
        .map_or(("", phrase), |(front, last)| (front, last));
    // A phrase the tables know as it stands ("chest of drawers", "stairs") is not touched.
    if CANONICAL_OF.contains_key(phrase) {
        return phrase.to_string();
    }
    let last = singular(last);
    if front.is_empty() {
        last
    } else {
        format!("{front} {last}")
    }
}

fn singular(word: &str) -> String {
    const IRREGULAR: &[(&str, &str)] = &[
        ("shelves", "shelf"),
        ("bookshelves", "bookshelf"),
        ("knives", "knife"),
        ("loaves", "loaf"),
        ("leaves", "leaf"),
        ("people", "person"),
        ("men", "man"),
        ("women", "woman"),
        ("children", "child"),
        ("mice", "mouse"),
        ("couches", "couch"),
        ("watches", "watch"),
        ("brushes", "brush"),
        ("shoes", "shoe"),
    ];
    if let Some((_, one)) = IRREGULAR.iter().find(|(many, _)| *many == word) {
        return (*one).to_string();
    }
    let untouched = word.len() <= 3
        || ["ss", "us", "is", "series"]
            .iter()
            .any(|end| word.ends_with(end))
        || !word.ends_with('s');
    if untouched {
        return word.to_string();
    }
    if let Some(stem) = word.strip_suffix("ies") {
        return format!("{stem}y");
    }
    for end in ["sses", "shes", "ches", "xes", "zes"] {
        if word.ends_with(end) {
            return word[..word.len() - 2].to_string();
        }
    }
    word[..word.len() - 1].to_string()
}

fn are_look_alikes(a: &str, b: &str) -> bool {
    LOOK_ALIKES
        .iter()
        .any(|group| group.contains(&a) && group.contains(&b))
}

static CANONICAL_OF: LazyLock<HashMap<&'static str, &'static str>> = LazyLock::new(|| {
    let mut map = HashMap::new();
    for group in SYNONYMS {
        for name in *group {
            map.entry(*name).or_insert(group[0]);
        }
    }
    map
});

static GROUP_OF: LazyLock<HashMap<&'static str, &'static str>> = LazyLock::new(|| {
    GROUPS
        .iter()
        .flat_map(|(group, names)| names.iter().map(move |name| (*name, *group)))
        .collect()
});

static ROOM_NAME_OF: LazyLock<HashMap<&'static str, &'static str>> = LazyLock::new(|| {
    ROOMS
        .iter()
        .flat_map(|room| room.names.iter().map(move |name| (*name, room.kind)))
        .collect()
});

/// Synonym groups, canonical name first. Singular, normalised.
const SYNONYMS: &[&[&str]] = &[
    &["sofa", "couch", "settee", "loveseat", "sectional"],
    &[
        "tv",
        "television",
        "tv set",
        "television set",
        "telly",
        "tv screen",
        "flat screen tv",
    ],
    &[
        "monitor",
        "computer monitor",
        "computer screen",
        "screen",
        "display",
    ],
    &[
        "trash can",
        "trash bin",
        "garbage can",
        "garbage bin",
        "waste bin",
        "wastebasket",
        "waste basket",
        "rubbish bin",
        "trashcan",
        "dustbin",
        "bin",
        "litter bin",
        "trash",
        "wastebin",
        "garbage",
    ],
    &["recycling bin", "recycle bin", "recycling can"],
    &["fridge", "refrigerator", "icebox"],
    &["stove", "cooker", "hob", "cooktop", "stovetop"],
    &["oven"],
    &["microwave", "microwave oven"],
    &["dishwasher", "dish washer"],
    &[
        "sink",
        "washbasin",
        "basin",
        "wash basin",
        "kitchen sink",
        "bathroom sink",
        "lavatory",
    ],
    &["toilet", "commode", "loo", "toilet bowl"],
    &["bathtub", "tub", "bath tub", "bath"],
    &["shower", "shower cabin", "shower stall"],
    &[
        "washing machine",
        "washer",
        "clothes washer",
        "laundry machine",
    ],
    &["dryer", "tumble dryer", "clothes dryer"],
    &["mug", "coffee mug", "tea mug", "beer mug"],
    &["cup", "teacup", "tea cup", "coffee cup", "paper cup"],
    &[
        "glass",
        "drinking glass",
        "water glass",
        "wine glass",
        "tumbler",
    ],
    &["bottle", "water bottle", "wine bottle"],
    &["plate", "dish", "dinner plate"],
    &["bowl", "fruit bowl"],
    &["pot", "cooking pot", "saucepan", "stockpot"],
    &["pan", "frying pan", "skillet"],
    &["kettle", "electric kettle", "tea kettle", "teakettle"],
    &[
        "coffee machine",
        "coffee maker",
        "espresso machine",
        "coffeemaker",
    ],
    &["toaster"],
    &["chair"],
    &[
        "office chair",
        "desk chair",
        "swivel chair",
        "task chair",
        "computer chair",
        "rolling chair",
    ],
    &[
        "armchair",
        "arm chair",
        "easy chair",
        "lounge chair",
        "recliner",
        "sofa chair",
    ],
    &["stool", "bar stool", "barstool"],
    &["bench"],
    &["ottoman", "footstool", "pouf", "foot stool", "footrest"],
    &["table"],
    &[
        "dining table",
        "dinner table",
        "kitchen table",
        "dining room table",
    ],
    &["coffee table", "cocktail table"],
    &[
        "nightstand",
        "night stand",
        "bedside table",
        "night table",
        "bedside cabinet",
    ],
    &["end table", "side table"],
    &[
        "desk",
        "work desk",
        "writing desk",
        "office desk",
        "workstation",
        "computer desk",
    ],
    &["meeting table", "conference table", "boardroom table"],
    &[
        "shelf",
        "shelving",
        "shelving unit",
        "shelf unit",
        "rack",
        "storage shelf",
    ],
    &[
        "bookshelf",
        "bookcase",
        "book shelf",
        "book case",
        "bookrack",
    ],
    &["wardrobe", "closet", "armoire", "wardrobe closet"],
    &[
        "dresser",
        "chest of drawers",
        "drawers",
        "drawer",
        "bureau",
        "chest of drawer",
    ],
    &["cabinet", "cupboard", "sideboard", "credenza"],
    &["kitchen cabinet", "kitchen cupboard"],
    &["file cabinet", "filing cabinet"],
    &[
        "counter",
        "countertop",
        "kitchen counter",
        "worktop",
        "counter top",
    ],
    &["bed"],
    &["pillow", "cushion", "throw pillow"],
    &["blanket", "duvet", "quilt", "comforter"],
    &["curtain", "drape", "drapes", "window curtain"],
    &["rug", "carpet", "area rug"],
    &["doormat", "door mat"],
    &["lamp"],
    &["table lamp", "desk lamp", "reading lamp", "bedside lamp"],
    &["floor lamp", "standing lamp"],
    &["light", "ceiling light", "light fixture", "ceiling lamp"],
    &[
        "plant",
        "potted plant",
        "houseplant",
        "house plant",
        "pot plant",
        "flowerpot",
        "flower pot",
        "indoor plant",
    ],
    &[
        "picture",
        "painting",
        "poster",
        "picture frame",
        "photo",
        "artwork",
        "framed picture",
        "photograph",
        "wall picture",
    ],
    &["mirror"],
    &["clock", "wall clock", "alarm clock"],
    &["whiteboard", "white board", "dry erase board"],
    &["blackboard", "chalkboard", "black board"],
    &["book", "paperback", "textbook"],
    &["laptop", "laptop computer", "notebook computer"],
    &[
        "computer",
        "computer tower",
        "pc",
        "desktop computer",
        "pc tower",
    ],
    &["keyboard", "computer keyboard"],
    &["mouse", "computer mouse"],
    &["printer"],
    &["photocopier", "copier", "copy machine", "copying machine"],
    &[
        "phone",
        "telephone",
        "smartphone",
        "cell phone",
        "mobile phone",
        "cellphone",
        "desk phone",
    ],
    &["speaker", "loudspeaker"],
    &["backpack", "rucksack", "knapsack"],
    &["suitcase", "luggage", "trolley case"],
    &["bag", "handbag", "purse"],
    &["box", "cardboard box", "carton", "package"],
    &["basket"],
    &["hamper", "laundry basket", "laundry hamper"],
    &["towel", "bath towel", "hand towel"],
    &["soap", "soap bottle"],
    &["soap dispenser"],
    &["toilet paper", "toilet roll", "toilet tissue"],
    &["paper towel dispenser"],
    &["umbrella"],
    &["umbrella stand"],
    &[
        "coat rack",
        "coat stand",
        "hat stand",
        "coat hanger",
        "clothes rack",
    ],
    &["shoe", "sneaker", "boot"],
    &["shoe rack", "shoe shelf"],
    &["bicycle", "bike"],
    &["vase", "flower vase"],
    &["candle"],
    &["remote", "remote control", "tv remote"],
    &["guitar"],
    &["piano"],
    &["fan", "electric fan"],
    &["radiator", "heater"],
    &["air conditioner", "ac", "air conditioning unit"],
    &["fire extinguisher", "extinguisher"],
    &["water cooler", "water dispenser", "water fountain"],
    &["vending machine", "snack machine"],
    &["projector", "beamer"],
    &["projector screen", "projection screen"],
    &["cart", "trolley"],
    &["ladder", "stepladder", "step ladder"],
    &["toolbox", "tool box", "tool chest"],
    &["broom"],
    &["mop"],
    &["bucket", "pail"],
    &["iron", "clothes iron"],
    &["ironing board"],
    &["vacuum cleaner", "vacuum", "hoover"],
    &["game console", "console", "gaming console"],
    &[
        "teddy bear",
        "stuffed animal",
        "plush toy",
        "soft toy",
        "stuffed toy",
    ],
    &["toy"],
    &["magazine"],
    &["newspaper", "paper"],
    &["notebook", "notepad"],
    &["pen", "pencil"],
    &["jacket", "coat"],
    &["person", "human", "man", "woman", "child"],
    &["stairs", "staircase", "stair", "stairway"],
    &["server rack", "server cabinet", "server"],
    &["workbench", "work bench", "lab bench"],
    &["tv stand", "tv table", "media console", "tv cabinet"],
    &["crib", "baby bed", "cot"],
    &["scale", "bathroom scale"],
    &["cutting board", "chopping board"],
    &["knife"],
    &["door"],
    &["window"],
    &["fruit", "apple", "banana", "orange fruit"],
];

/// Groups whose members a camera confuses.
const LOOK_ALIKES: &[&[&str]] = &[
    &["mug", "cup", "glass"],
    &[
        "desk",
        "table",
        "dining table",
        "meeting table",
        "workbench",
    ],
    &[
        "coffee table",
        "end table",
        "nightstand",
        "ottoman",
        "table",
    ],
    &["sofa", "armchair"],
    &["chair", "armchair", "office chair", "stool"],
    &["shelf", "bookshelf"],
    &[
        "cabinet",
        "kitchen cabinet",
        "file cabinet",
        "dresser",
        "wardrobe",
        "shelf",
        "counter",
    ],
    &["dresser", "nightstand"],
    &["tv", "monitor", "projector screen"],
    &["backpack", "bag", "suitcase"],
    &["box", "basket", "hamper"],
    &["trash can", "recycling bin", "bucket", "hamper"],
    &["whiteboard", "projector screen", "blackboard", "picture"],
    &["plant", "vase"],
    &["bottle", "vase", "soap"],
    &["stove", "oven"],
    &["washing machine", "dishwasher", "dryer"],
    &["printer", "photocopier", "microwave"],
    &["microwave", "oven", "toaster"],
    &["book", "magazine", "notebook", "laptop"],
    &["lamp", "floor lamp", "table lamp", "light"],
    &["plate", "bowl"],
    &["pot", "pan", "kettle"],
    &["towel", "blanket"],
    &["rug", "doormat"],
    &["mirror", "picture", "window"],
    &["bench", "stool", "ottoman"],
    &["toilet", "bathtub"],
    &["kettle", "coffee machine"],
    &["phone", "remote"],
    &["keyboard", "laptop"],
    &["cabinet", "fridge"],
    &["broom", "mop"],
];

/// Functional groups.
const GROUPS: &[(&str, &[&str])] = &[
    (
        "seating",
        &[
            "chair",
            "office chair",
            "armchair",
            "stool",
            "bench",
            "sofa",
            "ottoman",
        ],
    ),
    (
        "work",
        &[
            "table",
            "desk",
            "meeting table",
            "coffee table",
            "dining table",
            "end table",
            "workbench",
            "counter",
            "computer",
            "laptop",
            "keyboard",
            "mouse",
            "printer",
            "photocopier",
            "phone",
            "pen",
            "notebook",
        ],
    ),
    (
        "storage",
        &[
            "cabinet",
            "kitchen cabinet",
            "file cabinet",
            "shelf",
            "bookshelf",
            "wardrobe",
            "dresser",
            "box",
            "basket",
            "hamper",
            "cart",
            "suitcase",
            "backpack",
            "bag",
            "shoe rack",
            "coat rack",
            "toolbox",
            "server rack",
            "tv stand",
            "book",
        ],
    ),
    (
        "display",
        &[
            "tv",
            "monitor",
            "projector",
            "projector screen",
            "whiteboard",
            "blackboard",
            "picture",
            "mirror",
            "clock",
            "screen",
        ],
    ),
    ("sleep", &["bed", "pillow", "blanket", "nightstand", "crib"]),
    (
        "kitchen",
        &[
            "fridge",
            "stove",
            "oven",
            "microwave",
            "dishwasher",
            "mug",
            "cup",
            "glass",
            "bottle",
            "plate",
            "bowl",
            "pot",
            "pan",
            "kettle",
            "coffee machine",
            "toaster",
            "water cooler",
            "vending machine",
            "cutting board",
            "knife",
            "fruit",
        ],
    ),
    (
        "wash",
        &[
            "sink",
            "toilet",
            "bathtub",
            "shower",
            "towel",
            "soap",
            "soap dispenser",
            "toilet paper",
            "washing machine",
            "dryer",
            "scale",
            "iron",
            "ironing board",
        ],
    ),
    (
        "light",
        &[
            "lamp",
            "table lamp",
            "floor lamp",
            "light",
            "candle",
            "window",
            "curtain",
        ],
    ),
    (
        "decor",
        &[
            "plant",
            "vase",
            "rug",
            "doormat",
            "piano",
            "guitar",
            "teddy bear",
            "toy",
        ],
    ),
    (
        "clean",
        &[
            "trash can",
            "recycling bin",
            "broom",
            "mop",
            "bucket",
            "vacuum cleaner",
        ],
    ),
];

/// Things that are seen from across a room.
const LARGE_OR_FIXED: &[&str] = &[
    "sofa",
    "bed",
    "table",
    "desk",
    "wardrobe",
    "bookshelf",
    "shelf",
    "cabinet",
    "fridge",
    "counter",
    "bathtub",
    "shower",
    "dresser",
    "piano",
    "chair",
    "armchair",
    "tv",
    "stove",
    "oven",
    "washing machine",
    "bench",
    "whiteboard",
    "blackboard",
    "rug",
    "door",
    "window",
    "curtain",
    "toilet",
    "sink",
    "vending machine",
    "photocopier",
    "bicycle",
    "crib",
    "dishwasher",
    "dryer",
    "stairs",
    "server rack",
    "workbench",
    "plant",
    "floor lamp",
    "coat rack",
    "stool",
    "nightstand",
];

struct RoomKindRow {
    kind: &'static str,
    names: &'static [&'static str],
    contents: &'static [&'static str],
}

/// Room kinds: names in use and contents, the most telling first.
const ROOMS: &[RoomKindRow] = &[
    RoomKindRow {
        kind: "kitchen",
        names: &[
            "kitchen",
            "kitchenette",
            "galley",
            "pantry kitchen",
            "tea kitchen",
        ],
        contents: &[
            "stove",
            "oven",
            "fridge",
            "dishwasher",
            "counter",
            "kitchen cabinet",
            "microwave",
            "kettle",
            "toaster",
            "sink",
            "pot",
            "pan",
            "plate",
            "bowl",
            "mug",
            "cup",
            "coffee machine",
            "glass",
            "cutting board",
            "bottle",
            "knife",
            "dining table",
            "fruit",
            "trash can",
            "cabinet",
            "stool",
            "chair",
            "table",
        ],
    },
    RoomKindRow {
        kind: "living room",
        names: &[
            "living room",
            "lounge",
            "sitting room",
            "family room",
            "livingroom",
            "parlor",
            "parlour",
            "living area",
        ],
        contents: &[
            "sofa",
            "tv",
            "coffee table",
            "tv stand",
            "armchair",
            "remote",
            "rug",
            "game console",
            "speaker",
            "floor lamp",
            "bookshelf",
            "piano",
            "guitar",
            "cushion",
            "ottoman",
            "pillow",
            "plant",
            "vase",
            "picture",
            "magazine",
            "book",
            "blanket",
            "candle",
            "end table",
            "lamp",
            "mug",
        ],
    },
    RoomKindRow {
        kind: "bedroom",
        names: &[
            "bedroom",
            "master bedroom",
            "guest room",
            "guest bedroom",
            "sleeping room",
        ],
        contents: &[
            "bed",
            "nightstand",
            "wardrobe",
            "pillow",
            "blanket",
            "dresser",
            "table lamp",
            "teddy bear",
            "clock",
            "mirror",
            "lamp",
            "rug",
            "curtain",
            "book",
            "phone",
            "picture",
            "suitcase",
            "armchair",
            "laptop",
        ],
    },
    RoomKindRow {
        kind: "bathroom",
        names: &[
            "bathroom",
            "washroom",
            "restroom",
            "wc",
            "toilet room",
            "shower room",
            "rest room",
            "mens room",
            "ladies room",
            "bath room",
        ],
        contents: &[
            "toilet",
            "shower",
            "bathtub",
            "toilet paper",
            "towel",
            "soap",
            "soap dispenser",
            "sink",
            "mirror",
            "scale",
            "hamper",
            "washing machine",
            "cabinet",
            "trash can",
        ],
    },
    RoomKindRow {
        kind: "office",
        names: &[
            "office",
            "study",
            "workroom",
            "home office",
            "open office",
            "work room",
            "study room",
        ],
        contents: &[
            "desk",
            "office chair",
            "computer",
            "keyboard",
            "mouse",
            "monitor",
            "laptop",
            "printer",
            "file cabinet",
            "phone",
            "bookshelf",
            "notebook",
            "pen",
            "table lamp",
            "backpack",
            "book",
            "trash can",
            "whiteboard",
            "lamp",
            "mug",
            "plant",
            "cabinet",
            "clock",
        ],
    },
    RoomKindRow {
        kind: "meeting room",
        names: &[
            "meeting room",
            "conference room",
            "boardroom",
            "board room",
            "seminar room",
            "classroom",
            "meetingroom",
        ],
        contents: &[
            "meeting table",
            "projector",
            "projector screen",
            "whiteboard",
            "tv",
            "office chair",
            "chair",
            "phone",
            "laptop",
            "plant",
            "clock",
            "bottle",
            "table",
            "monitor",
            "cup",
            "glass",
            "notebook",
            "picture",
        ],
    },
    RoomKindRow {
        kind: "dining room",
        names: &["dining room", "dining area", "dinner room", "diningroom"],
        contents: &[
            "dining table",
            "chair",
            "candle",
            "cabinet",
            "vase",
            "plate",
            "glass",
            "table",
            "bowl",
            "picture",
            "rug",
            "plant",
            "bottle",
            "light",
        ],
    },
    RoomKindRow {
        kind: "corridor",
        names: &[
            "corridor",
            "hallway",
            "hall",
            "passage",
            "entrance",
            "entry",
            "entryway",
            "foyer",
            "vestibule",
            "passageway",
            "entrance hall",
        ],
        contents: &[
            "coat rack",
            "shoe rack",
            "umbrella stand",
            "doormat",
            "shoe",
            "fire extinguisher",
            "umbrella",
            "jacket",
            "bench",
            "water cooler",
            "picture",
            "mirror",
            "clock",
            "rug",
            "plant",
            "stairs",
        ],
    },
    RoomKindRow {
        kind: "storage",
        names: &[
            "storage",
            "storage room",
            "storeroom",
            "pantry",
            "utility room",
            "supply room",
            "store room",
            "storage closet",
            "closet room",
            "supply closet",
            "garage",
            "workshop",
            "basement",
        ],
        contents: &[
            "ladder",
            "broom",
            "mop",
            "bucket",
            "toolbox",
            "vacuum cleaner",
            "box",
            "cart",
            "shelf",
            "bicycle",
            "suitcase",
            "basket",
            "fan",
            "cabinet",
            "hamper",
            "ironing board",
        ],
    },
    RoomKindRow {
        kind: "laundry room",
        names: &["laundry room", "laundry", "wash room"],
        contents: &[
            "washing machine",
            "dryer",
            "ironing board",
            "iron",
            "hamper",
            "basket",
            "towel",
            "sink",
            "shelf",
            "bucket",
            "mop",
        ],
    },
    RoomKindRow {
        kind: "break room",
        names: &[
            "break room",
            "canteen",
            "cafeteria",
            "staff room",
            "coffee corner",
            "coffee room",
            "tea room",
            "lunch room",
            "breakroom",
        ],
        contents: &[
            "vending machine",
            "coffee machine",
            "water cooler",
            "microwave",
            "fridge",
            "mug",
            "cup",
            "sink",
            "sofa",
            "table",
            "kettle",
            "chair",
            "stool",
            "counter",
            "trash can",
            "plate",
            "bottle",
            "plant",
            "magazine",
        ],
    },
    RoomKindRow {
        kind: "print room",
        names: &[
            "print room",
            "copy room",
            "printer room",
            "copier room",
            "mail room",
        ],
        contents: &[
            "photocopier",
            "printer",
            "recycling bin",
            "newspaper",
            "shelf",
            "box",
            "cabinet",
            "counter",
            "trash can",
        ],
    },
    RoomKindRow {
        kind: "server room",
        names: &["server room", "machine room", "data room"],
        contents: &[
            "server rack",
            "air conditioner",
            "computer",
            "fire extinguisher",
            "cabinet",
            "monitor",
            "keyboard",
        ],
    },
    RoomKindRow {
        kind: "lab",
        names: &["lab", "laboratory", "iot lab", "iot laboratory"],
        contents: &[
            "workbench",
            "computer",
            "monitor",
            "stool",
            "shelf",
            "toolbox",
            "cabinet",
            "keyboard",
            "laptop",
            "sink",
            "fire extinguisher",
            "box",
            "desk",
            "fan",
        ],
    },
    RoomKindRow {
        kind: "lobby",
        names: &[
            "lobby",
            "reception",
            "waiting room",
            "waiting area",
            "reception area",
        ],
        contents: &[
            "magazine",
            "sofa",
            "armchair",
            "plant",
            "water cooler",
            "coffee table",
            "newspaper",
            "umbrella stand",
            "counter",
            "clock",
            "picture",
            "bench",
            "rug",
            "vase",
        ],
    },
    RoomKindRow {
        kind: "library",
        names: &["library", "reading room"],
        contents: &[
            "bookshelf",
            "book",
            "armchair",
            "magazine",
            "desk",
            "table lamp",
            "floor lamp",
            "ladder",
            "newspaper",
            "table",
            "rug",
        ],
    },
    RoomKindRow {
        kind: "nursery",
        names: &[
            "nursery",
            "childrens room",
            "kids room",
            "child room",
            "playroom",
            "kid room",
        ],
        contents: &[
            "crib",
            "teddy bear",
            "toy",
            "bed",
            "rug",
            "desk",
            "book",
            "dresser",
            "box",
            "lamp",
        ],
    },
];

/// Colour words with reference colours (sRGB).
const COLORS: &[(&str, [f64; 3])] = &[
    ("red", [190.0, 40.0, 40.0]),
    ("green", [60.0, 140.0, 70.0]),
    ("blue", [50.0, 90.0, 180.0]),
    ("yellow", [220.0, 200.0, 60.0]),
    ("orange", [230.0, 130.0, 40.0]),
    ("brown", [120.0, 80.0, 50.0]),
    ("black", [30.0, 30.0, 32.0]),
    ("white", [235.0, 235.0, 232.0]),
    ("gray", [130.0, 130.0, 130.0]),
    ("grey", [130.0, 130.0, 130.0]),
    ("silver", [180.0, 182.0, 186.0]),
    ("pink", [230.0, 150.0, 170.0]),
    ("purple", [120.0, 60.0, 140.0]),
    ("violet", [120.0, 60.0, 140.0]),
    ("beige", [215.0, 200.0, 170.0]),
    ("cream", [235.0, 225.0, 200.0]),
    ("tan", [200.0, 170.0, 125.0]),
    ("turquoise", [60.0, 180.0, 175.0]),
    ("teal", [30.0, 125.0, 125.0]),
    ("golden", [200.0, 165.0, 70.0]),
    ("gold", [200.0, 165.0, 70.0]),
    ("maroon", [110.0, 35.0, 40.0]),
    ("navy", [35.0, 45.0, 95.0]),
];

const MATERIALS: &[(&str, &str)] = &[
    ("wood", "wood"),
    ("wooden", "wood"),
    ("oak", "wood"),
    ("pine", "wood"),
    ("metal", "metal"),
    ("metallic", "metal"),
    ("steel", "metal"),
    ("iron", "metal"),
    ("aluminium", "metal"),
    ("aluminum", "metal"),
    ("plastic", "plastic"),
    ("leather", "leather"),
    ("fabric", "fabric"),
    ("cloth", "fabric"),
    ("textile", "fabric"),
    ("wool", "fabric"),
    ("cotton", "fabric"),
    ("ceramic", "ceramic"),
    ("porcelain", "ceramic"),
    ("marble", "stone"),
    ("stone", "stone"),
    ("granite", "stone"),
    ("paper", "paper"),
    ("cardboard", "paper"),
    ("rubber", "rubber"),
    ("wicker", "wicker"),
    ("rattan", "wicker"),
    ("glassy", "glass"),
    ("velvet", "fabric"),
    ("bamboo", "wood"),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn similarity(asked: &str, label: &str) -> f64 {
        class_similarity(&Class::new(asked), &Class::new(label))
    }

    #[test]
    fn synonyms_plurals_kinds_and_look_alikes() {
        assert_eq!(similarity("sofas", "Sofa"), 1.0);
        assert_eq!(similarity("couch", "sofa"), 0.95);
        assert_eq!(similarity("garbage bin", "trash_can"), 0.95);
        assert_eq!(similarity("chair", "folding chair"), 0.8);
        assert_eq!(similarity("folding chair", "chair"), 0.7);
        assert_eq!(similarity("mug", "cup"), 0.5);
        assert_eq!(similarity("unicorn", "horse"), 0.0);
        assert_eq!(similarity("unicorn", "unicorns"), 1.0);
        assert_eq!(similarity("", ""), 0.0);
    }

    #[test]
    fn singular_leaves_words_that_only_look_plural() {
        for (many, one) in [
            ("glasses", "glass"),
            ("glass", "glass"),
            ("boxes", "box"),
            ("stairs", "stairs"),
            ("shelves", "shelf"),
            ("trash cans", "trash can"),
            ("batteries", "battery"),
            ("bus", "bus"),
            ("vases", "vase"),
        ] {
            assert_eq!(singular_phrase(many), one);
        }
    }

    #[test]
    fn contents_tell_the_kind_of_a_room() {
        let contents: Vec<Class> = ["toilet", "sink", "towel"]
            .iter()
            .map(|name| Class::new(name))
            .collect();
        let best = kind_probabilities(&contents)
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("table is not empty");
        assert_eq!(best.0, "bathroom");
        assert!(best.1 > 0.8, "{best:?}");
        let flat = kind_probabilities(&[]);
        assert!(
            flat.iter()
                .all(|(_, p)| (p - 1.0 / flat.len() as f64).abs() < 1e-12)
        );
        assert_eq!(
            room_kind("the Conference-Room".trim_start_matches("the ")),
            Some("meeting room")
        );
    }

    #[test]
    fn every_table_entry_is_normalised_and_canonical() {
        for name in SYNONYMS.iter().flat_map(|group| group.iter()) {
            assert_eq!(normalise(name), **name);
        }
        for room in ROOMS {
            for name in room.names {
                assert_eq!(
                    singular_phrase(&normalise(name)),
                    **name,
                    "room name must be its own singular"
                );
            }
        }
    }
}
