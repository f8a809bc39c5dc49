//! What is assumed of a line and of its units, in one place.

/// Something that is assumed, because nothing that comes over a line could show it.
///
/// Whatever else a line does, what is taken for the answer is the answer. Each says where it is used, and what happens on a line
/// on which it does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Assumption {
    /// A unit gives each request one answer at the most.
    ///
    /// Then an open answer that was seen is owed no more. The same frame again with no silence between is taken for the line's
    /// doing and counts once. A unit that answers twice, with a pause, has a second answer that nothing is known of: it may be
    /// taken for the answer to the next read of the same length.
    AnswersOnce,
    /// An answer has as many words as were asked for, or the first of its unit that has not comes in its turn.
    ///
    /// Then the length of an answer tells reads apart, and where it was seen to tell nothing, it is not relied on any more: only an
    /// echo and time end a doubt about such a unit. Where its first answer of another length overtakes, it may be taken for that
    /// to another read, whose length it has.
    AnswersWhole,
    /// An answer comes within [`OVERTAKING`](crate::OVERTAKING), or four time-outs where that is longer, of being given up, or
    /// never.
    ///
    /// What comes later is taken for the answer to what is asked then, where it has its unit, its function and its length. The rest
    /// of one that broke off comes within a second, or two time-outs where that is less: a later rest may be taken for a damaged
    /// answer to what is asked then, which is owed no more, and is taken for the next of its length.
    AnswersInTime,
    /// What another program asked before the line was opened is answered in the order it was asked, and within
    /// [`FIRST_CONTACT`](crate::FIRST_CONTACT).
    ///
    /// Then an echo that comes back shows that nothing older is to come. Where another's answer overtakes the echo, it may be
    /// taken for the answer to the first read behind that.
    OthersInOrder,
    /// A serial server whose line others ask on, too, passes answers on in the order they were asked for.
    ///
    /// Then a length that is asked for the first time is one's own where none like it came before the answer to another read.
    /// Where answers change places there, another master's may be taken for one's own.
    SharedInOrder,
    /// What is damaged on its way does not have the right CRC by chance.
    ///
    /// One damaged answer in 65 536 has, and is believed where it also has the unit, the function and the length that are
    /// waited for. [`Question::verify`](crate::Question#structfield.verify) asks until two in a row agree.
    DamageShows,
}

impl Assumption {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::AnswersOnce,
        Self::AnswersWhole,
        Self::AnswersInTime,
        Self::OthersInOrder,
        Self::SharedInOrder,
        Self::DamageShows,
    ];

    /// What is assumed, in a sentence.
    pub const fn text(self) -> &'static str {
        match self {
            Self::AnswersOnce => "A unit answers at most once each time it is asked.",
            Self::AnswersWhole => {
                "It answers with as many words as it was asked for; where it does not, the first such answer comes in its turn."
            }
            Self::AnswersInTime => {
                "It answers within three seconds, or four time-outs where that is longer, after it was given up, or never."
            }
            Self::OthersInOrder => {
                "What another program asked before the line was opened is answered in order, and within a second."
            }
            Self::SharedInOrder => {
                "A serial server that others ask through, too, passes answers on in the order they were asked for."
            }
            Self::DamageShows => "What is damaged does not have the right CRC by chance, as one in 65 536 has.",
        }
    }
}

#[cfg(test)]
mod tests {
    use core::mem::discriminant;

    use super::*;
    use crate::{FIRST_CONTACT, OVERTAKING};

    #[test]
    fn each_is_there_once_and_says_something_of_its_own() {
        for (index, one) in Assumption::ALL.into_iter().enumerate() {
            for other in &Assumption::ALL[index + 1..] {
                assert_ne!(discriminant(&one), discriminant(other));
                assert_ne!(one.text(), other.text());
            }
        }
    }

    #[test]
    fn the_times_that_are_told_are_those_that_are_kept() {
        assert_eq!((OVERTAKING.as_secs(), FIRST_CONTACT.as_secs()), (3, 1));
    }
}
