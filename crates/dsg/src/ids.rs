//! Ids of nodes: 64-bit numbers that a swap cannot confuse, never reused, printed short ("O12", "R3").

use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident, $prefix:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u64);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!($prefix, "{}"), self.0)
            }
        }
    };
}

id!(
    /// An object (layer 2), "O12".
    ObjectId, "O"
);
id!(
    /// A place (layer 3), "P7". The number is the one the place graph gave it.
    PlaceId, "P"
);
id!(
    /// A room (layer 4), "R3".
    RoomId, "R"
);
id!(
    /// A building (layer 5), "B0".
    BuildingId, "B"
);
id!(
    /// A robot with a trajectory, "A0".
    AgentId, "A"
);
id!(
    /// A functional group of objects, "G2".
    GroupId, "G"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_print_short_and_keep_all_64_bits() {
        assert_eq!(ObjectId(12).to_string(), "O12");
        assert_eq!(RoomId(3).to_string(), "R3");
        let largest = PlaceId(u64::MAX);
        let text = serde_json::to_string(&largest).unwrap();
        assert_eq!(text, "18446744073709551615");
        assert_eq!(serde_json::from_str::<PlaceId>(&text).unwrap(), largest);
    }
}
