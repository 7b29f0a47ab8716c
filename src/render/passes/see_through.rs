//! Buildings that are open, over all that was drawn before them: alone where no billboards are drawn among them.

use super::{DrawInto, Recording, Translucent};

/// Records them, the farthest first. Needs no pipeline of its own.
pub(crate) fn record(recording: &mut Recording<'_>, into: &DrawInto<'_>, opened: &Translucent) {
    let mut pass = recording.draw("see_through", into);
    (0..opened.len()).for_each(|idx| opened.draw(&mut pass, idx));
}
