//! The flags of the live view, and what is said of it.

use super::{report, warn};
use softjam::record::{Ended, Header, Live, Outcome, Viewer};
use softjam::text::counted;

/// A viewer to look on through.
#[derive(clap::Args)]
pub struct LiveFlags {
    /// Start the rerun viewer (the program `rerun`) and show the run in it as it goes; a viewer that listens at PORT
    /// already is used.
    ///
    /// The viewer is sent what the file gets, ten times a second. The run never waits for it: at most 16 MiB of
    /// steps wait for it, of which every other frame is dropped when more come. At the end, when the file is closed, it
    /// has 2 s to take what is left, and before that up to 10 s to come up.
    #[arg(
        long,
        value_name = "PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "9876",
        value_parser = clap::value_parser!(u16).range(1..),
        conflicts_with = "connect",
        help_heading = LIVE
    )]
    spawn: Option<u16>,

    /// Show the run, as it goes, in a rerun viewer that is running (start one with `rerun`); by default the one at
    /// rerun+http://127.0.0.1:9876/proxy.
    ///
    /// Bounds as for --spawn, but a viewer that is not there is not waited for: it is asked for five times a second while
    /// the run lasts.
    #[arg(
        long,
        value_name = "URL",
        num_args = 0..=1,
        default_missing_value = Viewer::URL,
        value_parser = Viewer::at,
        help_heading = LIVE
    )]
    connect: Option<Viewer>,
}

const LIVE: &str = "Live view";

/// A live view, or none.
pub struct View(Option<(Live, String)>);

impl LiveFlags {
    /// Starts the live view that was asked for. Without it the run goes on.
    pub fn start(&self, header: &Header) -> View {
        let viewer = match (self.spawn, &self.connect) {
            (Some(port), _) => Viewer::start(port),
            (None, Some(viewer)) => Ok(viewer.clone()),
            (None, None) => return View(None),
        };
        let started = viewer.and_then(|viewer| {
            let place = viewer.to_string();
            Ok((Live::start(viewer, header.clone())?, place))
        });
        let tell = |error: &_| warn(&format!("no live view: {error}"));
        View(started.inspect_err(tell).ok())
    }
}

impl View {
    pub fn view(&self) -> Option<&Live> {
        self.0.as_ref().map(|(live, _)| live)
    }

    /// Gives the viewer the time it has, and says what it was shown.
    pub fn finish(self, outcome: Option<Outcome>) -> anyhow::Result<()> {
        let Some((live, place)) = self.0 else {
            return Ok(());
        };
        let shown = live.finish(outcome);
        let of = format!("{} of {}", shown.sent, counted(shown.of, "recorded step"));
        match shown.ended {
            Ended::Complete => report(&format!("{:<14} {of} shown at {place}\n", "live view"))?,
            Ended::Absent => warn(&format!("no live view: no viewer came up at {place}")),
            Ended::Late => warn(&format!("the viewer at {place} was too slow: {of} sent")),
            Ended::Lost(why) => warn(&format!(
                "the viewer at {place} was lost: {of} sent ({why})"
            )),
        }
        Ok(())
    }
}
