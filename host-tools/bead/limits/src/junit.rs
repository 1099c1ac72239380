//! The result as JUnit XML, which CI systems read: a suite for each recording, a case for each limit and
//! bead.

use quick_junit::{NonSuccessKind, Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use crate::judged::{JudgedLimit, JudgedRecording};
use crate::rule::Outcome;
use crate::words::{sentence, subject};

/// The document. A limit that is broken is a failure, and one that was not decided an error.
///
/// # Errors
/// The text cannot be written as XML.
pub fn document(title: &str, recordings: &[JudgedRecording]) -> Result<String, SerializeError> {
    let mut report = Report::new(if title.is_empty() { "limits" } else { title });
    for recording in recordings {
        let mut suite = TestSuite::new(&recording.recording);
        suite.add_test_cases(recording.limits.iter().map(|limit| case(title, limit)));
        report.add_test_suite(suite);
    }
    report.to_string()
}

fn case(title: &str, limit: &JudgedLimit) -> TestCase {
    let mut status = match limit.outcome {
        Outcome::Pass => TestCaseStatus::success(),
        Outcome::Fail => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Outcome::Undecided => TestCaseStatus::non_success(NonSuccessKind::Error),
    };
    if limit.outcome != Outcome::Pass {
        status.set_message(sentence(limit)).set_type(limit.outcome.name());
        status.set_description(limit.rule.text());
    }
    let mut case = TestCase::new(subject(limit), status);
    case.set_classname(if title.is_empty() { "limits" } else { title });
    case
}
