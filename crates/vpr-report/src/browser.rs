//! Pages as Chromium shows them, for tests; nothing without it.

use std::{io, path::Path, process::Command};

use serde_json::Value;

/// What is asked of every page: that everybody can read it, hear it and reach it.
const AUDIT: &str = include_str!("browser/audit.js");

/// Violations that axe-core calls serious or worse, and how many of its rules held.
const AXE: &str = "async (page) => { \
    const own = page.createElement('script'); \
    own.textContent = document.getElementById('library').textContent; \
    page.head.append(own); \
    const found = await page.defaultView.axe.run(page); \
    const serious = found.violations.filter((it) => ['serious', 'critical'].includes(it.impact)); \
    return { passed: found.passes.length, \
        serious: serious.map((it) => it.id + ': ' + it.nodes[0].html.slice(0, 120)) }; }";

/// The document of a file once its scripts have run. Fails if one of them, or a policy, complained;
/// `None` without a browser, which is said.
pub(crate) fn document(path: &Path, fragment: &str, is_dark: bool) -> Option<String> {
    shown(path, fragment, is_dark, &[])
}

#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn shown(path: &Path, fragment: &str, is_dark: bool, more: &[&str]) -> Option<String> {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"])
        .args(["--enable-logging=stderr", "--window-size=1600,900"])
        .args(more)
        .arg(format!("--blink-settings=preferredColorScheme={}", u8::from(!is_dark)))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}{fragment}", path.display()))
        .output();
    let output = match output {
        Ok(output) => output,
        Err(err) if err.kind() == io::ErrorKind::NotFound => {
            eprintln!("skipped: chromium is not installed");
            return None;
        }
        Err(err) => panic!("{err}"),
    };
    let log = String::from_utf8_lossy(&output.stderr);
    let complaint = log.lines().find(|line| line.contains(":CONSOLE"));
    assert_eq!(complaint, None, "a script or a policy complained");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What a script, a function of a document, answers of a page in a window of this width. Browsers
/// make no narrow windows, so the page is shown in a frame.
pub(crate) fn ask(page: &str, width: u32, is_dark: bool, script: &str) -> Option<Value> {
    ask_with("", page, width, is_dark, script)
}

/// The same with a library, the text of a script, beside the page: `library.textContent`.
fn ask_with(library: &str, page: &str, width: u32, is_dark: bool, script: &str) -> Option<Value> {
    let quoted = page.replace('&', "&amp;").replace('"', "&quot;");
    let frame = format!(
        "<!doctype html>\n<body><iframe style=\"border:0;width:{width}px;height:900px\" srcdoc=\"{quoted}\"></iframe>\n\
         <script type=\"text/plain\" id=\"library\">{library}</script>\n\
         <script>onload=async()=>{{const page=document.querySelector('iframe').contentDocument;\
         document.body.textContent='answer:'+JSON.stringify(await ({script})(page))}}</script>\n"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.html");
    std::fs::write(&path, frame).unwrap();
    // What the script waits for is waited for; times that it measures are none.
    let document = shown(&path, "", is_dark, &["--virtual-time-budget=60000"])?;
    let answer = document.split("answer:").nth(1).expect("the script answers");
    let answer = answer.split("</body>").next().unwrap();
    let plain = answer.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    Some(serde_json::from_str(&plain).unwrap())
}

/// Fails if a page is narrower than its content, too faint, without a name for what is seen or
/// used, out of order, or out of reach of the keyboard: on a telephone and on a wide screen, in
/// light and in dark.
pub(crate) fn audit(page: &str) {
    for (width, is_dark) in [(360, false), (360, true), (1600, false), (1600, true)] {
        let Some(faults) = ask(page, width, is_dark, AUDIT) else { return };
        let checked = faults["checked"].as_u64().unwrap();
        assert!(checked > 0, "no text was looked at");
        let faults = &faults["faults"];
        assert_eq!(faults, &serde_json::json!([]), "at {width} pixels, dark: {is_dark}");
        let Some(library) = axe_core() else { continue };
        let found = ask_with(&library, page, width, is_dark, AXE).expect("a browser, as above");
        assert!(found["passed"].as_u64().unwrap() > 5, "axe-core checked nothing: {found}");
        assert_eq!(found["serious"], serde_json::json!([]), "{width} pixels, dark: {is_dark}");
    }
}

/// The text of axe-core, an audit that others keep, from the file that `VPR_AXE` names.
#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn axe_core() -> Option<String> {
    let Some(path) = std::env::var_os("VPR_AXE") else {
        eprintln!("skipped: VPR_AXE names no axe.min.js of axe-core");
        return None;
    };
    let library = std::fs::read_to_string(&path).unwrap();
    assert!(!library.contains("</script"), "cannot stand inside of a page");
    Some(library)
}

#[test]
fn faults_are_found() {
    let page = "<html><head><title></title></head><body><h1>a</h1><h3 style=\"color:#999;background:#fff\">faint</h3>\
                <img src=\"data:,\"><input><a href=\"x\"></a><svg role=\"img\"></svg><p style=\"width:2000px\">wide</p>\
                <button tabindex=\"2\" id=\"b\">b</button><i id=\"b\"></i>\
                <div style=\"overflow:auto;width:9px;height:9px\">long words here</div>\
                <table><tr><th>t</th></tr></table></body></html>";
    let Some(found) = ask(page, 360, false, AUDIT) else { return };
    let found = found["faults"].to_string();
    for fault in [
        "no language",
        "no title",
        "h3 after h1",
        "contrast",
        "img without a text",
        "svg without a name",
        "input without a label",
        "a without a name",
        "is wider than",
        "tabindex",
        "id b twice",
        "out of reach of the keyboard",
        "th without a scope",
        "no main",
    ] {
        assert!(found.contains(fault), "{fault} is not in {found}");
    }
    let Some(library) = axe_core() else { return };
    let found = ask_with(&library, page, 360, false, AXE).unwrap().to_string();
    for rule in ["image-alt", "color-contrast", "label", "link-name", "html-has-lang"] {
        assert!(found.contains(&format!("{rule}: ")), "{rule} is not in {found}");
    }
}
