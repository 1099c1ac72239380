//! Live channels for Foxglove and Lichtblick.
//!
//! # Design
//! Each bead has the channels `/bead_7/strike` and `/bead_7/state` of JSON objects, whose schemas are made of
//! the types that are sent. A new subscriber gets the last message of a channel at once, as strikes may be
//! rare. Clients can only read. The protocol has no secret and does not check a page's origin, so any
//! program and any web page on a computer that reaches the address can read.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServerHandle};
use schemars::{JsonSchema, schema_for};
use serde::Serialize;

use crate::model::{BeadView, SharedMonitor};
use crate::publish::{News, publish};
use crate::strike::{Curves, ShownStrike};

/// A strike with its curves, as it is sent.
#[derive(Serialize, JsonSchema)]
struct StrikeMessage<'a> {
    #[serde(flatten)]
    strike: &'a ShownStrike,
    /// Time of each scan from the trigger, ms.
    time_ms: Vec<f64>,
    /// Null without settings or if the start of the window is missing.
    curves: Option<&'a Curves>,
}

impl<'a> StrikeMessage<'a> {
    fn of(strike: &'a ShownStrike) -> Self {
        let curves = strike.curves();
        let times = |curves: &Curves| {
            let scans = 0..curves.force_n.len();
            scans
                .map(|scan| curves.from_ms + curves.step_ms * scan as f64)
                .collect()
        };
        Self {
            strike,
            time_ms: curves.map(times).unwrap_or_default(),
            curves,
        }
    }
}

/// Sends the last message of a channel to each new subscriber.
struct Greeter {
    context: Arc<Context>,
    /// The last message of each channel, by topic, with its time in ns since 1970.
    last: Mutex<BTreeMap<String, (Vec<u8>, u64)>>,
}

impl ServerListener for Greeter {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let found = self.context.get_channel_by_topic(channel.topic());
        if let (Some(found), Some((message, time))) = (found, last.get(channel.topic())) {
            found.log_with_meta_to_sink(message, PartialMetadata::with_log_time(*time), client.sink_id());
        }
    }
}

/// A server of channels.
pub struct FoxgloveServer {
    greeter: Arc<Greeter>,
    handle: WebSocketServerHandle,
}

impl FoxgloveServer {
    /// Listens at an address; port 0 stands for a free one.
    ///
    /// # Errors
    /// The address is another computer's or the port is taken.
    pub fn open(at: SocketAddr) -> Result<Self, FoxgloveError> {
        let greeter = Arc::new(Greeter {
            context: Context::new(),
            last: Mutex::default(),
        });
        let server = greeter.context.websocket_server().name("bead monitor");
        let server = server.bind(at.ip().to_string(), at.port());
        let handle = server.listener(greeter.clone()).start_blocking()?;
        Ok(Self { greeter, handle })
    }

    /// The port at which it listens.
    pub fn port(&self) -> u16 {
        self.handle.port()
    }

    /// Sends each strike, and the state of each bead once a second, until `stop`.
    pub fn serve(self, monitor: &SharedMonitor, stop: &AtomicBool) {
        publish(monitor, stop, |news| {
            let (topic, message, schema) = match news {
                News::Strike(strike) => {
                    let message = serde_json::to_vec(&StrikeMessage::of(strike));
                    ("strike", message, schema_for!(StrikeMessage<'_>))
                }
                News::State(state) => ("state", serde_json::to_vec(state), schema_for!(BeadView)),
            };
            let topic = format!("/bead_{}/{topic}", news.bead());
            let schema = Schema::new(
                topic.as_str(),
                "jsonschema",
                schema.to_value().to_string().into_bytes(),
            );
            // Neither fails: the types are objects, and a topic that exists keeps its schema.
            if let (Ok(message), Ok(channel)) = (message, self.channel(&topic, schema)) {
                let time = (news.time() * 1e9) as u64;
                channel.log_with_meta(&message, PartialMetadata::with_log_time(time));
                let mut last = self.greeter.last.lock().unwrap_or_else(PoisonError::into_inner);
                last.insert(topic, (message, time));
            }
        });
        self.handle.stop().wait_blocking();
    }

    /// The channel of a topic.
    fn channel(&self, topic: &str, schema: Schema) -> Result<Arc<RawChannel>, FoxgloveError> {
        let context = &self.greeter.context;
        if let Some(channel) = context.get_channel_by_topic(topic) {
            return Ok(channel);
        }
        let builder = context.channel_builder(topic);
        builder.message_encoding("json").schema(schema).build_raw()
    }
}
