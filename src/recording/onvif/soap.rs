//! Messages to a device, and what its answers mean.

use super::xml::{at, children, text_at};
use super::{OnvifError, xml};
use roxmltree::Node;

/// Most letters of a fault's code that are told.
const MAX_CODE_LETTERS: usize = 60;

/// A question to a device.
pub(super) struct Question {
    /// The service's namespace.
    pub(super) namespace: &'static str,
    /// The operation, which its answer has the name of.
    pub(super) operation: &'static str,
    /// Elements within the operation's, whose own namespace is `q`.
    pub(super) inner: String,
    /// Callers that may ask it.
    pub(super) asked_by: AskedBy,
}

/// Those who may ask a question, as the standard has it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum AskedBy {
    /// Everybody.
    Everybody,
    /// Those who are logged in, where the device wants that.
    LoggedIn,
}

impl Question {
    /// Returns a question for whoever is logged in.
    pub(super) const fn new(namespace: &'static str, operation: &'static str, inner: String) -> Self {
        Self { namespace, operation, inner, asked_by: AskedBy::LoggedIn }
    }

    /// Returns the message, with a login where `security` is one.
    pub(super) fn message(&self, security: &str) -> String {
        let Self { namespace, operation, inner, .. } = self;
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
             <s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\"><s:Header>{security}</s:Header>\
             <s:Body><q:{operation} xmlns:q=\"{namespace}\" xmlns:t=\"http://www.onvif.org/ver10/schema\">{inner}</q:{operation}>\
             </s:Body></s:Envelope>"
        )
    }

    /// Returns what the message is sent as.
    pub(super) fn content_type(&self) -> String {
        let Self { namespace, operation, .. } = self;
        format!("application/soap+xml; charset=utf-8; action=\"{namespace}/{operation}\"")
    }
}

/// Answer to a question.
#[derive(Debug)]
pub(super) enum Outcome<T> {
    /// It is answered.
    Answered(T),
    /// It is refused for want of a login, or for a wrong one.
    NotAuthorized,
    /// It is refused otherwise, or not answered at all.
    Failed(OnvifError),
}

/// Reads the answer to `question` from a message's text.
pub(super) fn verdict<T>(
    text: &str,
    question: &Question,
    read: impl FnOnce(Node<'_, '_>) -> Option<T>,
) -> Outcome<T> {
    let document = match xml::read(text) {
        Ok(document) => document,
        Err(error) => return Outcome::Failed(error),
    };
    let Some(body) = at(document.root_element(), &["Body"]) else {
        return Outcome::Failed(OnvifError::NotUnderstood);
    };
    if let Some(fault) = children(body, "Fault").next() {
        return if is_of_login(fault) {
            Outcome::NotAuthorized
        } else {
            Outcome::Failed(OnvifError::Refused { code: code_of(fault) })
        };
    }
    let name = format!("{}Response", question.operation);
    let answer = body.children().find(|child| child.is_element() && child.tag_name().name() == name);
    answer.and_then(read).map_or(Outcome::Failed(OnvifError::NotUnderstood), Outcome::Answered)
}

/// Returns true where a fault is about who asks; devices say so in any of its parts.
fn is_of_login(fault: Node<'_, '_>) -> bool {
    const WORDS: [&str; 6] = [
        "notauthorized",
        "notauthorised",
        "unauthorized",
        "failedauthentication",
        "authorityfailure",
        "invalidusername",
    ];
    let said: String = fault
        .descendants()
        .filter_map(|node| node.text())
        .flat_map(str::chars)
        .filter(|letter| letter.is_ascii_alphanumeric())
        .map(|letter| letter.to_ascii_lowercase())
        .collect();
    WORDS.iter().any(|word| said.contains(word))
}

/// Returns the most exact code of a fault, without its prefix.
fn code_of(fault: Node<'_, '_>) -> String {
    let exact = fault.descendants().rfind(|node| node.tag_name().name() == "Value");
    let code = exact.and_then(|node| node.text()).or_else(|| text_at(fault, &["faultcode"]));
    let code = code.unwrap_or_default().trim();
    let code = code.rsplit(':').next().unwrap_or_default();
    let code: String = code.chars().filter(char::is_ascii_alphanumeric).take(MAX_CODE_LETTERS).collect();
    if code.is_empty() { "a fault without a code".to_owned() } else { code }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(body: &str) -> Outcome<String> {
        let question = Question::new("urn:x", "GetIt", String::new());
        let text = format!("<e:Envelope xmlns:e='urn:e'><e:Body>{body}</e:Body></e:Envelope>");
        verdict(&text, &question, |node| text_at(node, &["It"]).map(str::to_owned))
    }

    #[test]
    fn answers_are_told_from_faults() {
        assert!(
            matches!(read("<GetItResponse><It>1</It></GetItResponse>"), Outcome::Answered(it) if it == "1")
        );
        let not =
            |body: &str| assert!(matches!(read(body), Outcome::Failed(OnvifError::NotUnderstood)), "{body}");
        not("<GetItResponse/>");
        not("<GetOtherResponse><It>1</It></GetOtherResponse>");
        not("");
        let no_login = [
            "<e:Fault><e:Code><e:Value>e:Sender</e:Value><e:Subcode><e:Value>ter:NotAuthorized</e:Value></e:Subcode></e:Code></e:Fault>",
            "<Fault><faultcode>wsse:FailedAuthentication</faultcode><faultstring>no</faultstring></Fault>",
            "<Fault><faultcode>SOAP-ENV:Client</faultcode><faultstring>Sender Not Authorized</faultstring></Fault>",
        ];
        for body in no_login {
            assert!(matches!(read(body), Outcome::NotAuthorized), "{body}");
        }
        let code = |body: &str, expected: &str| {
            let Outcome::Failed(OnvifError::Refused { code }) = read(body) else { panic!("{body}") };
            assert_eq!(code, expected);
        };
        code(
            "<Fault><Code><Value>e:Receiver</Value><Subcode><Value>ter:ActionNotSupported</Value></Subcode></Code>\
             <Reason><Text>s3cret</Text></Reason></Fault>",
            "ActionNotSupported",
        );
        code(
            "<Fault><faultcode>e:Client\u{1b}[2J</faultcode></Fault>".replace('\u{1b}', "").as_str(),
            "Client2J",
        );
        code("<Fault/>", "a fault without a code");
    }

    #[test]
    fn questions_are_well_formed() {
        let question =
            Question::new("http://www.onvif.org/ver10/device/wsdl", "GetServices", "<q:X>1</q:X>".to_owned());
        let message = question.message("");
        let document = xml::read(&message).unwrap();
        let asked = at(document.root_element(), &["Body", "GetServices"]).unwrap();
        assert_eq!(asked.tag_name().namespace(), Some("http://www.onvif.org/ver10/device/wsdl"));
        assert_eq!(text_at(asked, &["X"]), Some("1"));
        assert!(
            question
                .content_type()
                .ends_with("action=\"http://www.onvif.org/ver10/device/wsdl/GetServices\"")
        );
    }
}
