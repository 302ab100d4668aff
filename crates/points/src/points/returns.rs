//! Which returns of its pulses a job keeps.

use serde::{Deserialize, Serialize};

/// The most returns of a pulse.
const MOST: u8 = 15;

/// Which return of its pulse a record is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PulseReturn {
    /// Its number, from 1; 0 where the file does not say.
    pub(crate) number: u8,
    /// The number of returns of the pulse; 0 where the file does not say.
    pub(crate) of: u8,
}

impl PulseReturn {
    /// Tells whether another return of the pulse came later.
    pub(crate) fn is_followed(self) -> bool {
        !KeptReturns::Last.has(self)
    }

    /// Returns whether both numbers are there and fit together.
    pub(crate) fn is_clear(self) -> bool {
        (1..=self.of).contains(&self.number)
    }
}

/// Which returns a job keeps. A record that does not say its return counts as the only one of its pulse: it is the first and the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "toml::Value", into = "toml::Value")]
pub enum KeptReturns {
    /// All of them.
    #[default]
    All,
    /// Those with the number 1, and those without a number.
    First,
    /// Those whose number is that of the returns of their pulse, or greater.
    Last,
    /// Those with these numbers: bit n stands for return n.
    Numbers(u16),
}

/// What is wrong with a choice of returns.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("returns is \"all\", \"first\", \"last\" or a list of numbers from 1 to {MOST}, such as [1, 2]")]
pub struct InvalidReturns;

impl KeptReturns {
    /// Returns whether the job keeps such a return.
    #[inline]
    pub(crate) fn has(self, PulseReturn { number, of }: PulseReturn) -> bool {
        match self {
            KeptReturns::All => true,
            KeptReturns::First => number <= 1,
            KeptReturns::Last => number >= of,
            KeptReturns::Numbers(bits) => bits.checked_shr(number.max(1).into()).is_some_and(|bits| bits & 1 == 1),
        }
    }

    /// Returns whether this is the same choice: [1] is "first".
    pub(crate) fn is_same(self, other: KeptReturns) -> bool {
        let plain = |returns| if returns == KeptReturns::Numbers(2) { KeptReturns::First } else { returns };
        plain(self) == plain(other)
    }
}

impl TryFrom<toml::Value> for KeptReturns {
    type Error = InvalidReturns;

    fn try_from(value: toml::Value) -> Result<KeptReturns, InvalidReturns> {
        match value {
            toml::Value::String(text) => match text.as_str() {
                "all" => Ok(KeptReturns::All),
                "first" => Ok(KeptReturns::First),
                "last" => Ok(KeptReturns::Last),
                _ => Err(InvalidReturns),
            },
            toml::Value::Array(numbers) if !numbers.is_empty() => {
                let bit = |number: &toml::Value| {
                    let number = number.as_integer().filter(|number| (1..=MOST.into()).contains(number));
                    number.map(|number| 1 << number).ok_or(InvalidReturns)
                };
                numbers.iter().try_fold(0, |bits, number| Ok(bits | bit(number)?)).map(KeptReturns::Numbers)
            }
            _ => Err(InvalidReturns),
        }
    }
}

impl From<KeptReturns> for toml::Value {
    fn from(returns: KeptReturns) -> toml::Value {
        match returns {
            KeptReturns::All => "all".into(),
            KeptReturns::First => "first".into(),
            KeptReturns::Last => "last".into(),
            KeptReturns::Numbers(bits) => {
                let numbers = (1..=MOST).filter(|number| bits >> number & 1 == 1);
                toml::Value::Array(numbers.map(|number| toml::Value::Integer(number.into())).collect())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns which of these returns of a pulse are kept, as (number, of).
    fn kept(returns: KeptReturns) -> Vec<(u8, u8)> {
        let all = [(1, 1), (1, 3), (2, 3), (3, 3), (0, 0), (0, 3), (4, 3), (2, 0), (16, 16)];
        all.into_iter().filter(|&(number, of)| returns.has(PulseReturn { number, of })).collect()
    }

    #[test]
    fn records_that_do_not_say_their_return_are_the_only_one_of_their_pulse() {
        assert_eq!(kept(KeptReturns::All).len(), 9);
        assert_eq!(kept(KeptReturns::First), [(1, 1), (1, 3), (0, 0), (0, 3)]);
        assert_eq!(kept(KeptReturns::Last), [(1, 1), (3, 3), (0, 0), (4, 3), (2, 0), (16, 16)]);
        assert_eq!(kept(KeptReturns::Numbers(1 << 1 | 1 << 3)), [(1, 1), (1, 3), (3, 3), (0, 0), (0, 3)]);
        let clear = [(1, 1), (2, 2), (0, 0), (0, 1), (2, 1), (1, 0)].map(|(number, of)| PulseReturn { number, of });
        assert_eq!(clear.map(PulseReturn::is_clear), [true, true, false, false, false, false]);
    }

    #[test]
    fn choices_are_read_from_names_and_lists_and_written_back() {
        let read = |text: &str| toml::from_str::<toml::Table>(&format!("returns = {text}")).unwrap()["returns"].clone();
        for (text, returns) in [
            ("\"all\"", KeptReturns::All),
            ("\"first\"", KeptReturns::First),
            ("\"last\"", KeptReturns::Last),
            ("[1]", KeptReturns::Numbers(2)),
            ("[2, 15]", KeptReturns::Numbers(1 << 15 | 4)),
        ] {
            assert_eq!(KeptReturns::try_from(read(text)), Ok(returns), "{text}");
            assert_eq!(toml::Value::from(returns), read(text));
            let json = serde_json::to_string(&returns).unwrap();
            assert_eq!(serde_json::from_str::<KeptReturns>(&json).unwrap(), returns, "{json}");
        }
        for text in ["[]", "[0]", "[16]", "[-1]", "[1.5]", "\"second\"", "1", "[\"first\"]", "true"] {
            assert_eq!(KeptReturns::try_from(read(text)), Err(InvalidReturns), "{text}");
        }
        assert!(
            KeptReturns::Numbers(2).is_same(KeptReturns::First) && !KeptReturns::Numbers(6).is_same(KeptReturns::First)
        );
    }
}
