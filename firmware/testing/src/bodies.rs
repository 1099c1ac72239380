//! Messages of one kind.

use bead_wire::Message;

/// The bodies of the messages of one kind, in their order.
pub fn bodies<'a, B: 'a>(messages: impl IntoIterator<Item = &'a Message>) -> impl Iterator<Item = &'a B>
where
    &'a B: TryFrom<&'a Message>,
{
    messages.into_iter().filter_map(|message| message.try_into().ok())
}
