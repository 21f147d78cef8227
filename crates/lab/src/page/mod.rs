//! The HTML pages of `kiln study` and `kiln bench`: a static file, in which the script of a command draws the JSON that is
//! embedded. A page from disk cannot fetch it.

/// Style sheet and functions of all pages, with the places of data and script in double braces.
const PAGE: &str = include_str!("page.html");

/// A page that is drawn by `script` from JSON texts, each in an element with its name.
pub(crate) fn page(script: &str, data: &[(&str, &str)]) -> String {
    let element = |(name, json): &(&str, &str)| {
        // In JSON, `<` is in strings alone, where its escape is the same character: no text closes the element.
        let json = json.replace('<', "\\u003c");
        format!("<script type=\"application/json\" id=\"{name}\">{json}</script>\n")
    };
    let data: String = data.iter().map(element).collect();
    PAGE.replace("{{script}}", script).replace("{{data}}", &data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_close_their_element() {
        let json = serde_json::json!({ "name": "</script><!--{{script}}" }).to_string();
        let page = page("draw_all();", &[("data", &json)]);
        let (_, embedded) = page.split_once("id=\"data\">").expect("an element");
        let (embedded, _) = embedded.split_once("</script>").expect("its end");
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(embedded).expect("JSON")["name"],
            "</script><!--{{script}}"
        );
        assert_eq!(page.matches("draw_all();").count(), 1);
    }
}
