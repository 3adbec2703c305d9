#include "haptic/html.hpp"

namespace haptic {

std::string html_text(std::string_view text) {
    std::string result;
    for (const char letter : text) {
        switch (letter) {
            case '&':
                result += "&amp;";
                break;
            case '<':
                result += "&lt;";
                break;
            case '>':
                result += "&gt;";
                break;
            case '"':
                result += "&quot;";
                break;
            default:
                result += letter;
        }
    }
    return result;
}

std::string page_top(std::string_view title) {
    const std::string text = html_text(title);
    std::string page =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>";
    page.append(text).append("</title>\n<style>\n").append(page_style()).append("</style></head>\n");
    return page.append("<body class=\"document\">\n<h1>").append(text).append("</h1>\n");
}

}  // namespace haptic
