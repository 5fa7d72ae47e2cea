//! "Of the 5 chairs closest to the door, the leftmost": a group named before the thing that is meant.

/// What is set apart before the head of a sentence.
pub(crate) struct FrontedGroup<'a> {
    pub(crate) count: u32,
    pub(crate) group: &'a str,
    /// The text without it.
    pub(crate) rest: String,
}

/// "in the hall, of the 5 chairs closest to the door, the leftmost": 5, "chairs closest to the door", "in the hall, the leftmost". None for any
/// text that sets nothing apart in this form.
pub(crate) fn fronted_group(text: &str) -> Option<FrontedGroup<'_>> {
    let parts: Vec<&str> = text.split(", ").collect();
    let at = parts.iter().position(|part| part.starts_with("of the "))?;
    let (count, group) = parts[at].strip_prefix("of the ")?.split_once(' ')?;
    let count = count.parse().ok().filter(|count| (2..=1000).contains(count))?;
    let rest: Vec<&str> =
        parts.iter().enumerate().filter(|(position, _)| *position != at).map(|(_, part)| *part).collect();
    (at + 1 < parts.len()).then(|| FrontedGroup { count, group, rest: rest.join(", ") })
}
